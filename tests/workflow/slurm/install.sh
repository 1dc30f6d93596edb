#!/bin/sh
# Installs what the test on a real SLURM needs, as far as this machine allows: install.sh PYTHON.
# It never fails; the test then says what it lacks.
"$1" -m pip install --quiet --disable-pip-version-check --no-deps \
    --require-hashes --requirement requirements-slurm.lock ||
    echo "test-slurm: the plugin could not be installed"
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null && ! command -v slurmctld >/dev/null; then
    export DEBIAN_FRONTEND=noninteractive
    { apt-get update -qq && apt-get install -y -qq --no-install-recommends slurm-wlm munge; } \
        >/dev/null || echo "test-slurm: slurm-wlm and munge could not be installed"
fi
exit 0
