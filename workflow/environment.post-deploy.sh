#!/usr/bin/env bash
# Installs what is locked, and nbv, into the Python first in PATH; run from the project's folder.
# `make` runs it in .venv, and Snakemake in the environment that it made of environment.yaml.
set -euo pipefail

install() { python -m pip install --quiet --disable-pip-version-check "$@"; }
# The locks hold all that is needed. pip 23.0 would look at the newest version of what a package
# asks for with an extra, and stop where that is newer than the locked one.
install_locked() { install --no-deps --require-hashes "$@"; }

# A few packages are built from source. pip would take their build tool without checking its hash,
# so it comes first.
setuptools=$(mktemp)
trap 'rm -f "$setuptools"' EXIT
sed -n '/^setuptools==/,/[^\\]$/p' requirements.lock > "$setuptools"
install_locked --requirement "$setuptools"

install_locked --no-build-isolation --requirement requirements.lock
install --requirement requirements-torch.lock
install --no-deps --no-build-isolation --editable .
