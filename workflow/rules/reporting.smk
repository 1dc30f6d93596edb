# What people read of the paper: tables, claims, figures, and the page that holds them all.

from nbv.experiment.report.figures import FIGURES
from nbv.experiment.report.tables import TABLES
from nbv.experiment.report.settings import (
    ReportSettings,
    focus_category,
    focus_unit,
    reference_units,
)

SETTINGS = ReportSettings(focus_category=CONFIG["focus_category"])
FOCUS = focus_category(UNITS, SETTINGS)
FOCUS_UNIT = focus_unit(UNITS, SETTINGS)
REFERENCE_UNITS = reference_units(UNITS, SETTINGS)
# Of the focus category at every elevation, or at the reference elevation alone. All other tables
# and figures compare the categories.
OF_ELEVATIONS = {"table2", "table4", "figure6"}
OF_FOCUS = {
    *("table5", "table6", "table7"),
    *("steps", "figure2", "figure3", "figure7", "figure8", "heatmaps"),
}
# Figures show no intervals.
SHOWN = {"methods": list(METHODS)}
RESAMPLED = SHOWN | {"n_resamples": CONFIG["n_resamples"], "seed": CONFIG["seed"]}
# Some figures show the lookup table of Proposed, which another policy does not have; some show
# depth images, which an external estimator does not have.
PROPOSED_LOOKUP = METHODS.get(SETTINGS.subject, {}).get("policy")
SHOWN_FIGURES = [
    name
    for name, kind in FIGURES.items()
    if PROPOSED_LOOKUP in LOOKUP_CRITERIA or "lookups" not in kind.needs
    if not (EXTERNAL and {"depth", "objects"} & set(kind.needs))
]


include: "captions.smk"


JOBS = sorted(counted_jobs(), key=lambda job: Path(job[1]).parts)


rule table:
    input:
        sources("tabulate_paper"),
        evaluations=lambda wildcards: paths(
            LAYOUT.evaluation, evaluations_of(units_of(wildcards.table))
        ),
    output:
        csv=table_in_report("csv", "numbers"),
        md=LAYOUT.table("{table}", "md"),
        tex=LAYOUT.table("{table}", "tex"),
        html=table_in_report("html", "as in the paper"),
    log:
        LAYOUT.log("table/{table}"),
    benchmark:
        LAYOUT.benchmark("table/{table}")
    wildcard_constraints:
        table="|".join(TABLES),
    conda:
        ENVIRONMENT
    params:
        settings=lambda wildcards: settings_of(RESAMPLED, wildcards.table),
        evaluations=lambda wildcards: evaluations_of(units_of(wildcards.table)),
        caution=CAUTION,
        caption=caption_of_table,
    script:
        f"{SCRIPTS}/tabulate_paper.py"


rule figure:
    input:
        sources("plot_paper"),
        unpack(figure_inputs),
    output:
        png=in_report(
            LAYOUT.figure("{figure}", "png"),
            "Figures",
            "result",
            {"figure": "{figure}"},
        ),
        pdf=LAYOUT.figure("{figure}", "pdf"),
        svg=LAYOUT.figure("{figure}", "svg"),
    log:
        LAYOUT.log("figure/{figure}"),
    benchmark:
        LAYOUT.benchmark("figure/{figure}")
    wildcard_constraints:
        figure="|".join(FIGURES),
    conda:
        ENVIRONMENT
    params:
        settings=lambda wildcards: settings_of(SHOWN, wildcards.figure),
        evaluations=lambda wildcards: evaluations_of(units_of(wildcards.figure)),
        units=lambda wildcards: units_of(wildcards.figure),
        folds=lambda wildcards: folds_of(units_of(wildcards.figure)),
        caption=caption_of_figure,
    script:
        f"{SCRIPTS}/plot_paper.py"


rule claims:
    input:
        sources("judge_claims"),
        evaluations=paths(LAYOUT.evaluation, evaluations_of(UNITS)),
    output:
        csv=in_report(LAYOUT.claims("csv"), "Claims", "result", {"form": "numbers"}),
        md=LAYOUT.claims("md"),
    log:
        LAYOUT.log("claims"),
    benchmark:
        LAYOUT.benchmark("claims")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        evaluations=evaluations_of(UNITS),
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
        caution=CAUTION,
        caption=caption_of(PAGES_SHOW["claims"], UNITS),
    script:
        f"{SCRIPTS}/judge_claims.py"


rule runtime:
    input:
        sources("tabulate_runtime"),
        benchmarks=[LAYOUT.benchmark(job) for _, job in JOBS],
        logs=[LAYOUT.log(job) for _, job in JOBS],
    output:
        csv=LAYOUT.table("runtime", "csv"),
        md=LAYOUT.table("runtime", "md"),
        html=in_report(
            LAYOUT.table("runtime", "html"), "Running time", "page", {"form": "table"}
        ),
    log:
        LAYOUT.log("runtime"),
    benchmark:
        LAYOUT.benchmark("runtime")
    conda:
        ENVIRONMENT
    params:
        rules=[rule for rule, _ in JOBS],
        caption=caption_of(PAGES_SHOW["runtime"], UNITS),
    script:
        f"{SCRIPTS}/tabulate_runtime.py"


rule report:
    input:
        sources("build_report"),
        configuration=rules.settings.output.configuration,
        provenance=rules.settings.output.provenance,
        claims=rules.claims.output.csv,
        runtime=rules.runtime.output.html,
        splits=[LAYOUT.splits(category) for category in CATEGORIES],
        tables=[LAYOUT.table(name, "html") for name in TABLES],
        table1=LAYOUT.table("table1", "csv"),
        figures=[LAYOUT.figure(name, "svg") for name in SHOWN_FIGURES],
    output:
        in_report(LAYOUT.report, "Report", "page", {"form": "page"}),
    log:
        LAYOUT.log("report"),
    benchmark:
        LAYOUT.benchmark("report")
    conda:
        ENVIRONMENT
    params:
        categories=CATEGORIES,
        tables=list(TABLES),
        figures=SHOWN_FIGURES,
        caution=CAUTION,
        caption=caption_of(PAGES_SHOW["report"], UNITS),
    script:
        f"{SCRIPTS}/build_report.py"


rule tables:
    input:
        rules.report.input.tables,


rule figures:
    input:
        rules.report.input.figures,


use rule figure as animate with:
    output:
        gif=LAYOUT.figure("{figure}", "gif"),
    log:
        LAYOUT.log("animate/{figure}"),
    benchmark:
        LAYOUT.benchmark("animate/{figure}")
    wildcard_constraints:
        figure="steps",


rule animation:
    input:
        lambda wildcards: (
            LAYOUT.figure("steps", "gif")
            if "steps" in SHOWN_FIGURES
            else stop("animation needs depth images and a lookup table of proposed")
        ),
