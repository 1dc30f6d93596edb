# Best next-viewpoint recommendation: meshes to tables.
#
#   snakemake --cores 2                                                  the paper
#   snakemake --cores 2 --config experiment=quick                        the paper, in minutes
#   snakemake --cores 2 tables                                           one stage
#   snakemake --cores 2 results/paper/evaluation/mug/el00/fold3/proposed.csv   one file
#   snakemake --cores 2 explorer                                         a page to play with
#   snakemake --cores 2 animation                                        the method on one object
#   snakemake --cores 2 bundles                                          what a robot needs
#   snakemake --cores 2 verify                                           is any file damaged?
#
# What goes beyond the paper is in studies/, with a Snakefile of its own.

import os
import sys

from snakemake.utils import min_version

min_version("9.12")  # has `pathvars`

# It is no path where Snakemake fetches a module file by file.
if not isinstance(workflow.current_basedir, os.PathLike):
    sys.exit(
        "nbv: error: the folder config is read from disk: clone the repository, and write the path "
        "of the clone's Snakefile after `snakefile:`"
    )


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
    bundles,


# The first rule is the default target; `default_target: True` would take that from a Snakefile which
# uses this one as a module.
rule all:
    input:
        "<results>/report.html",


include: "workflow/rules/data.smk"
include: "workflow/rules/estimation.smk"
include: "workflow/rules/recommendation.smk"
include: "workflow/rules/reporting.smk"
include: "workflow/rules/explorer.smk"
include: "workflow/rules/verification.smk"
include: "workflow/rules/reference.smk"
include: "workflow/rules/bundles.smk"


if CONFIG["experiment"] == "features":

    include: "workflow/rules/features.smk"
