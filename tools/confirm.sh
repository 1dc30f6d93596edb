#!/usr/bin/env bash
# The confirmatory run of docs/protocol.md. It takes hours; the same command goes on where it was stopped.
#   MESHES=<folder of airplane, car, chair, toilet> adds real meshes
#   MUGS=<ShapeNetCore> WITHOUT_HANDLE=<file of ids> adds real mugs
set -euo pipefail
cores=${CORES:-2}
# With up to 100 pseudo-observations V is nearly flat on 20 pairs a row; let the choice go on.
density="density.pseudo_observations=[3,10,30,100,300,1000]"
kept=()

# Both estimators on one run's objects: name, data set, further settings.
train() {
    local estimator suffix
    for estimator in regressor classifier; do
        suffix=${estimator#regressor}
        suffix=${suffix:+-$suffix}
        snakemake --cores "$cores" confirm --config name="$1$suffix" estimator="$estimator" "${@:4}" \
            overrides="[confirmation.dataset=$2$suffix,elevations_deg.mug=[0],$density,$3]"
        kept+=("results/$1$suffix/confirmation/estimates.npz")
    done
}

train embedded embedded "seed=11"
if [[ -n ${MESHES:-} ]]; then
    train real-meshes real \
        "dataset.root=$MESHES,n_objects=null,categories=[airplane,car,chair,toilet]" dataset=folder
fi
if [[ -n ${MUGS:-} ]]; then
    train real-mugs real \
        "dataset.root=$MUGS,categories=[mug]${WITHOUT_HANDLE:+,dataset.exclude_file=$WITHOUT_HANDLE}" \
        dataset=shapenet
fi
from=$(IFS=,; echo "${kept[*]}")
snakemake --cores "$cores" statistics --config name=confirmation from="[$from]"
