# Best next-viewpoint recommendation: meshes to tables.
#
#   snakemake --cores 2                                                  the paper
#   snakemake --cores 2 --config experiment=quick                        the same graph, small
#   snakemake --cores 2 tables                                           one stage
#   snakemake --cores 2 beyond                                           what goes beyond the paper
#   snakemake --cores 2 transfer                                         trained on × tested on
#   snakemake --cores 2 results/paper/evaluation/mug/el00/fold3/proposed.csv   one file

from snakemake.utils import min_version

min_version("9.0")


include: "workflow/rules/common.smk"


localrules:
    all,
    renders,
    estimators,
    estimates,
    lookups,
    evaluation,
    tables,
    figures,
    contest,
    beyond,
    transfer,


rule all:
    default_target: True
    input:
        f"{RESULTS}/report.html",


include: "workflow/rules/render.smk"
include: "workflow/rules/estimate.smk"
include: "workflow/rules/recommend.smk"
include: "workflow/rules/reading.smk"
include: "workflow/rules/read.smk"
include: "workflow/rules/contests.smk"
include: "workflow/rules/beyond.smk"
include: "workflow/rules/ablation.smk"
include: "workflow/rules/conditions.smk"
include: "workflow/rules/transfer.smk"
include: "workflow/rules/beside.smk"


onstart:
    lift_rate_limit()
    Path(LAST_ERROR).unlink(missing_ok=True)
    banner(
        f"nbv: experiment {CONFIG['experiment']}, data set {CONFIG['dataset']['source']}, "
        f"{len(UNITS)} units of {CONFIG['n_folds']} folds",
        f"results: {RESULTS}/    logs: {RESULTS}/logs/",
    )


onsuccess:
    banner(
        "nbv: finished",
        f"results: {RESULTS}/    read first: {RESULTS}/report.html",
    )


onerror:
    banner(
        "nbv: stopped",
        *last_error(),
        "what was finished is kept; the same command goes on from there",
        f"logs: {RESULTS}/logs/",
    )
