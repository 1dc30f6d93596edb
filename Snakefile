# Best next-viewpoint recommendation: meshes to tables.
#
#   snakemake --cores 2                                                  the paper
#   snakemake --cores 2 --config experiment=quick                        the same graph, small
#   snakemake --cores 2 tables                                           one stage
#   snakemake --cores 2 explorer                                         a page to play with
#   snakemake --cores 2 extensions                                       the extensions
#   snakemake --cores 2 animation                                        the method on one object
#   snakemake --cores 2 transfer                                         trained on × tested on
#   snakemake --cores 2 confirm                                          several trainings
#   snakemake --cores 2 verify                                           is any file damaged?
#   snakemake --cores 2 results/paper/evaluation/mug/el00/fold3/proposed.csv   one file

from snakemake.utils import min_version

min_version("9.0")


report: "workflow/report/run.rst"


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
    animation,
    extension_evaluations,
    extensions,
    transfer,
    confirm,
    bundles,


rule all:
    default_target: True
    input:
        LAYOUT.report,


include: "workflow/rules/data.smk"
include: "workflow/rules/estimation.smk"
include: "workflow/rules/recommendation.smk"
include: "workflow/rules/reporting.smk"
include: "workflow/rules/explorer.smk"
include: "workflow/rules/verification.smk"
include: "workflow/rules/reference.smk"
# The paper ends here. What follows is beyond it, and nothing above depends on it.
include: "workflow/rules/extensions/common.smk"
include: "workflow/rules/extensions/methods.smk"
include: "workflow/rules/extensions/leaderboard.smk"
include: "workflow/rules/extensions/more_views.smk"
include: "workflow/rules/extensions/travel.smk"
include: "workflow/rules/extensions/ablation.smk"
include: "workflow/rules/extensions/transfer.smk"
include: "workflow/rules/extensions/runs.smk"
include: "workflow/rules/extensions/confirmation.smk"
include: "workflow/rules/bundles.smk"


rule extensions:
    input:
        rules.leaderboard.output,
        rules.more_views.output,
        rules.travel.output,


onstart:
    forget_last_error()
    banner(
        f"nbv: experiment {CONFIG['experiment']}, data set {CONFIG['dataset']['source']}, "
        f"{len(UNITS)} units of {CONFIG['n_folds']} folds",
        f"results: {LAYOUT.root}/    logs: {LAYOUT.logs}/",
    )


onsuccess:
    banner(
        "nbv: finished",
        f"results: {LAYOUT.root}/"
        # A run of some tables alone has none.
        + (
            f"    read first: {LAYOUT.report}"
            if Path(LAYOUT.report).is_file()
            else ""
        ),
        *CAUTION,
    )


onerror:
    banner(
        "nbv: stopped",
        *why_stopped(LAYOUT.logs, STARTED, log),
        "what was finished is kept; the same command goes on from there",
        f"logs: {LAYOUT.logs}/",
    )
