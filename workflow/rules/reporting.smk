# What people read of the paper: tables, claims, figures, and the page that holds them all.

from nbv.experiment.report.figures import FIGURES
from nbv.experiment.report.settings import SUBJECT
from nbv.experiment.report.tables import TABLES

# Some figures show the lookup table of Proposed, which another policy does not have; some show
# depth images, which an external estimator does not have.
PROPOSED_LOOKUP = METHODS.get(SUBJECT, {}).get("policy")
SHOWN_FIGURES = [
    name
    for name, kind in FIGURES.items()
    if PROPOSED_LOOKUP in PLAN.lookup_criteria or "lookups" not in kind.needs
    if not (PLAN.external and {"depth", "objects"} & set(kind.needs))
]
JOBS = PLAN.jobs(TABLES, SHOWN_FIGURES)


include: "shown.smk"


rule table:
    input:
        code=sources("tabulate_paper"),
        evaluations=lambda wildcards: paths(
            "<results>/evaluation/{category}/el{elevation}/fold{fold}/{method}.csv",
            evaluations_for(wildcards.table),
        ),
    output:
        csv=table_in_report("csv", "numbers"),
        md="<results>/tables/{table}.md",
        tex="<results>/tables/{table}.tex",
        html=table_in_report("html", "as in the paper"),
    log:
        "<logs>/table/{table}.log",
    benchmark:
        "<benchmarks>/table/{table}.tsv"
    wildcard_constraints:
        table="|".join(TABLES),
    conda:
        ENVIRONMENT
    params:
        settings=lambda wildcards: PLAN.settings_of(wildcards.table),
        evaluations=lambda wildcards: evaluations_for(wildcards.table),
        caution=PLAN.caution,
        caption=caption_of_table,
    script:
        "../scripts/tabulate_paper.py"


rule figure:
    input:
        unpack(figure_inputs),
        code=sources("plot_paper"),
    output:
        png=in_report(
            "<results>/figures/{figure}.png",
            "Figures",
            "result",
            {"figure": "{figure}"},
        ),
        pdf="<results>/figures/{figure}.pdf",
        svg="<results>/figures/{figure}.svg",
    log:
        "<logs>/figure/{figure}.log",
    benchmark:
        "<benchmarks>/figure/{figure}.tsv"
    wildcard_constraints:
        figure="|".join(FIGURES),
    conda:
        ENVIRONMENT
    params:
        settings=lambda wildcards: PLAN.settings_of(wildcards.figure),
        evaluations=lambda wildcards: evaluations_for(wildcards.figure),
        units=lambda wildcards: PLAN.units_of(wildcards.figure),
        folds=lambda wildcards: PLAN.folds_of(PLAN.units_of(wildcards.figure)),
        caption=caption_of_figure,
    script:
        "../scripts/plot_paper.py"


rule claims:
    input:
        code=sources("judge_claims"),
        evaluations=paths(
            "<results>/evaluation/{category}/el{elevation}/fold{fold}/{method}.csv",
            PLAN.evaluations_of(UNITS),
        ),
    output:
        csv=in_report("<results>/claims.csv", "Claims", "result", {"form": "numbers"}),
        md="<results>/claims.md",
    log:
        "<logs>/claims.log",
    benchmark:
        "<benchmarks>/claims.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        evaluations=PLAN.evaluations_of(UNITS),
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
        caution=PLAN.caution,
        caption=caption_of(PAGES_SHOW["claims"], UNITS),
    script:
        "../scripts/judge_claims.py"


rule runtime:
    input:
        code=sources("tabulate_runtime"),
        benchmarks=[f"<benchmarks>/{job}.tsv" for _, job in JOBS],
        logs=[f"<logs>/{job}.log" for _, job in JOBS],
    output:
        csv="<results>/tables/runtime.csv",
        md="<results>/tables/runtime.md",
        html=in_report(
            "<results>/tables/runtime.html", "Running time", "page", {"form": "table"}
        ),
    log:
        "<logs>/runtime.log",
    benchmark:
        "<benchmarks>/runtime.tsv"
    conda:
        ENVIRONMENT
    params:
        rules=[rule for rule, _ in JOBS],
        caption=caption_of(PAGES_SHOW["runtime"], UNITS),
    script:
        "../scripts/tabulate_runtime.py"


rule report:
    input:
        code=sources("build_report"),
        configuration=rules.settings.output.configuration,
        provenance=rules.settings.output.provenance,
        claims=rules.claims.output.csv,
        runtime=rules.runtime.output.html,
        splits=paths("<results>/splits/{category}.csv", zip(CONFIG["categories"])),
        tables=[f"<results>/tables/{name}.html" for name in TABLES],
        table1="<results>/tables/table1.csv",
        figures=[f"<results>/figures/{name}.svg" for name in SHOWN_FIGURES],
    output:
        in_report("<results>/report.html", "Report", "page", {"form": "page"}),
    log:
        "<logs>/report.log",
    benchmark:
        "<benchmarks>/report.tsv"
    conda:
        ENVIRONMENT
    params:
        categories=CONFIG["categories"],
        docs=os.path.relpath(ROOT / "docs", PLAN.results),
        tables=list(TABLES),
        figures=SHOWN_FIGURES,
        caution=PLAN.caution,
        caption=caption_of(PAGES_SHOW["report"], UNITS),
    script:
        "../scripts/build_report.py"


rule tables:
    input:
        rules.report.input.tables,


rule figures:
    input:
        rules.report.input.figures,


use rule figure as animate with:
    output:
        gif="<results>/figures/{figure}.gif",
    log:
        "<logs>/animate/{figure}.log",
    benchmark:
        "<benchmarks>/animate/{figure}.tsv"
    wildcard_constraints:
        figure="steps",


rule animation:
    input:
        steps_animation,
