#!/usr/bin/env bash
# The confirmatory run of docs/reference/confirmation/protocol.md. It takes hours; the same command goes on where it was stopped.
#   MESHES=<folder of airplane, car, chair, toilet> COPIES=<file of ids> adds other people's meshes
#   MUGS=<ShapeNetCore> WITHOUT_HANDLE=<file of ids> adds their mugs
#   ESTIMATORS="linear linear_classifier" trains no networks
set -euo pipefail
cores=${CORES:-2}
# Three bandwidths, and pseudo-observations from hardly any to a V that is nearly flat.
density="density.bandwidths_deg=[4,8,16],density.pseudo_observations=[0.3,3,30,300]"
kept=()

# The estimators on one run's objects: name, data set, further settings. The last command tabulates all of them.
train() {
    local estimator suffix file
    for estimator in ${ESTIMATORS:-regressor classifier}; do
        suffix=${estimator#regressor}
        suffix=${suffix:+-$suffix}
        # Nobody had trained on objects or folds of this seed.
        file=results/$1$suffix/confirmation/estimates.npz
        snakemake --cores "$cores" --snakefile studies/Snakefile "$file" --config name="$1$suffix" estimator="$estimator" "${@:4}" \
            overrides="[confirmation.dataset=$2$suffix,seed=12,elevations_deg.mug=[0],$density${3:+,$3}]"
        kept+=("$file")
    done
}

train embedded embedded ""
if [[ -n ${MESHES:-} ]]; then
    train real-meshes real \
        "dataset.root=$MESHES,n_objects=null,categories=[airplane,car,chair,toilet]${COPIES:+,dataset.exclude_file=$COPIES}" \
        dataset=folder
fi
if [[ -n ${MUGS:-} ]]; then
    train real-mugs real \
        "dataset.root=$MUGS,n_objects=null,categories=[mug]${WITHOUT_HANDLE:+,dataset.exclude_file=$WITHOUT_HANDLE}" \
        dataset=shapenet
fi
from=$(IFS=,; echo "${kept[*]}")
snakemake --cores "$cores" --snakefile studies/Snakefile statistics --config name=confirmation from="[$from]"
