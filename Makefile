# make quick       the paper, in minutes        make reproduce the paper, with a network for every fold
# make environment what both set up first: .venv, from the locks
# make test        the test suite, in minutes   make check   lint, types, imports, workflow lint
# make test-studies the studies and the estimators beside the default one, run small
# make test-faults the workflow after kills and on a full disk
# make bench       the speed benchmarks         make compare a finished run with docs/reference
# make confirm     several trainings of all data sets, for hours (tools/confirm.sh)
# make bundles     the bundles that the package ships, for an hour or more
# make features    the depth features that the package ships, for half an hour
# make test-slurm  the workflow on a real SLURM of one node, where root may install it
# make test-browser the pages in a real browser, where there is one or root may install it
# make test-site    the documentation site: every link, equation and name in it
# make coverage    branches that tests reach    make mutation whether tests notice changed code
# make audit       known vulnerabilities        make licences the licences of what is locked
# make lock        the locks again              UPGRADE=--upgrade takes the newest versions
# make soak        2,000 damaged files, for half an hour at most
# make docs        the documentation site, build/site/index.html
# make tables      the pages' tables of numbers, from docs/reference

PYTHON ?= python3
CORES ?= 2
# make compare EXPERIMENT=quick
EXPERIMENT ?= paper
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
AUDIT := $(VENV)/.audit-ready
DOCS := $(VENV)/.docs-ready
INSTALL_LOCKED := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes
PYTEST := $(BIN)/pytest --numprocesses $(CORES) --dist worksteal
LOCK := $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes \
	--no-annotate --custom-compile-command "make lock"

.PHONY: environment reproduce quick confirm bundles features compare reference bench test test-quick test-studies test-faults test-slurm test-browser test-site soak coverage mutation \
	check lock audit licences docs tables clean

environment: $(READY)

reproduce: $(READY)
	@echo "nbv: now the paper: usually 20 to 45 minutes on two cores"
	$(BIN)/snakemake --cores $(CORES)

quick: $(READY)
	@echo "nbv: now the paper with linear estimators: usually four minutes on two cores"
	$(BIN)/snakemake --cores $(CORES) --config experiment=quick

confirm: $(READY)
	PATH="$(CURDIR)/$(BIN):$$PATH" CORES=$(CORES) tools/confirm.sh

compare: $(READY)
	$(BIN)/snakemake --cores $(CORES) compare --config experiment=$(EXPERIMENT)

bundles: $(READY)
	$(BIN)/snakemake --cores $(CORES) bundles --config experiment=bundles estimator=classifier \
		randomisation=camera sensor=kinect
	mkdir -p src/nbv/bundles/shipped
	cp results/bundles-classifier/bundles/mug.safetensors src/nbv/bundles/shipped/

# On another machine the weights differ in their last bits: compare the errors of make quick with both.
features: $(READY)
	$(BIN)/snakemake --cores $(CORES) features --config experiment=features
	cp results/features/feature_training/features.safetensors src/nbv/experiment/estimation/

reference: $(READY)
	$(BIN)/snakemake --cores $(CORES) reference --config experiment=$(EXPERIMENT)

bench: $(READY)
	$(BIN)/python -m performance

test: $(READY)
	$(PYTEST)

test-quick: $(READY)
	$(PYTEST) -m "not slow" --ignore tests/studies

test-studies: $(READY)
	$(PYTEST) tests/workflow/studies

# Not in parallel: the kills are timed by an undisturbed run.
test-faults: $(READY)
	$(BIN)/pytest tests/faults

# Not where it can be neither found nor installed: one line then says why.
test-slurm: $(READY)
	tests/workflow/slurm/install.sh $(BIN)/python
	$(BIN)/pytest -rs --log-cli-level=INFO --log-cli-format="%(asctime)s %(message)s" tests/workflow/slurm

# Likewise.
test-browser: $(READY)
	tests/browser/install.sh
	$(BIN)/pytest -rs tests/browser

test-site: $(READY) $(DOCS)
	$(BIN)/pytest tests/website

coverage: $(READY)
	$(PYTEST) -m "not slow" --cov --cov-report=term

mutation: $(AUDIT)
	$(BIN)/mutmut run --max-children $(CORES)
	$(BIN)/mutmut results

lock: $(AUDIT)
	$(LOCK) $(UPGRADE) pyproject.toml --extra experiment --group dev --no-emit-package torch --output-file requirements.lock
	echo "numpy<2" | $(subst 3.11,3.10,$(LOCK)) $(UPGRADE) pyproject.toml - --fork-strategy fewest --output-file requirements-robot.lock
	$(LOCK) $(UPGRADE) --group audit --constraints requirements.lock --output-file requirements-audit.lock
	$(LOCK) $(UPGRADE) --group docs --constraints requirements.lock --constraints requirements-audit.lock --output-file requirements-docs.lock
	$(BIN)/python tools/extra.py slurm | $(LOCK) --no-deps --output-file requirements-slurm.lock -

audit: $(AUDIT)
	$(BIN)/pip-audit --strict --disable-pip --require-hashes --requirement requirements.lock
	$(BIN)/pip-audit --strict --disable-pip --no-deps --requirement requirements-torch.lock
	$(BIN)/pip-audit --strict --disable-pip --require-hashes --requirement requirements-robot.lock
	$(BIN)/pip-audit --strict --disable-pip --require-hashes --requirement requirements-slurm.lock
	$(BIN)/pip-audit --strict --disable-pip --require-hashes --requirement requirements-docs.lock

licences: $(AUDIT) $(DOCS)
	$(BIN)/python tools/licences.py

soak: $(READY)
	$(BIN)/python -m tests.fuzz

tables: $(READY)
	$(BIN)/python tools/tables.py

docs: $(DOCS)
	$(BIN)/python -m sphinx --quiet --jobs $(CORES) --fail-on-warning --keep-going --conf-dir docs/site --doctree-dir build/doctrees . build/site
	@echo "the site: build/site/index.html"

check: $(READY)
	$(BIN)/python -m pip check
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy --python-version 3.10 --no-warn-return-any --package nbv.core --package nbv.data --package nbv.frames --package nbv.choice --package nbv.bundles --package nbv.tables
	$(BIN)/lint-imports
	$(BIN)/snakefmt --check Snakefile workflow studies
	$(BIN)/snakemake --lint
	$(BIN)/snakemake --snakefile studies/Snakefile --lint

$(READY): requirements.lock requirements-torch.lock workflow/environment.post-deploy.sh pyproject.toml
	@echo "nbv: first the environment: what is locked, into $(VENV); usually two minutes and 1.9 GB, once only"
	@$(PYTHON) -c 'import sys; (3, 11) <= sys.version_info[:2] <= (3, 13) or sys.exit("nbv needs Python 3.11 to 3.13, this is " + sys.version.split()[0] + ": make PYTHON=python3.12 ...")'
	$(PYTHON) -m venv --clear $(VENV)
	PATH="$(CURDIR)/$(BIN):$$PATH" bash workflow/environment.post-deploy.sh
	touch $@
	@echo "nbv: the environment is ready"

$(AUDIT): $(READY) requirements-audit.lock requirements-slurm.lock
	$(INSTALL_LOCKED) \
		--requirement requirements-audit.lock --requirement requirements-slurm.lock
	touch $@

$(DOCS): $(READY) requirements-docs.lock
	$(INSTALL_LOCKED) --requirement requirements-docs.lock
	touch $@

clean:
	rm -rf $(VENV) build/site build/doctrees mutants .coverage* .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
