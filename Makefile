# make reproduce   the paper, end to end        make quick   the same graph, small
# make test        the test suite               make check   lint, types, imports, workflow lint
# make bench       the speed benchmarks         make compare a finished run with docs/reference
# make soak        2,000 damaged files, for half an hour at most

PYTHON ?= python3
CORES ?= 2
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: reproduce quick compare reference bench test test-quick soak check clean

reproduce: $(READY)
	$(BIN)/snakemake --cores $(CORES)

quick: $(READY)
	$(BIN)/snakemake --cores $(CORES) --config experiment=quick

compare: $(READY)
	$(BIN)/snakemake --cores $(CORES) compare

reference: $(READY)
	$(BIN)/snakemake --cores $(CORES) reference

bench: $(READY)
	$(BIN)/python -m performance

test: $(READY)
	$(BIN)/pytest

test-quick: $(READY)
	$(BIN)/pytest -m "not slow"

soak: $(READY)
	$(BIN)/python -m tests.fuzz

check: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/snakemake --lint

$(READY): requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; (3, 11) <= sys.version_info[:2] <= (3, 13) or sys.exit("nbv needs Python 3.11 to 3.13, this is " + sys.version.split()[0] + ": make PYTHON=python3.12 ...")'
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

clean:
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
