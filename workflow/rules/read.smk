# What people read: tables, claims, figures, and the page that holds them all.


rule table:
    input:
        sources("table"),
        evaluations=lambda wildcards: evaluations_of(units_of(wildcards.table)),
    output:
        expand(f"{RESULTS}/tables/{{{{table}}}}.{{kind}}", kind=["csv", "md", "tex"]),
    log:
        log_path("table/{table}"),
    benchmark:
        benchmark_path("table/{table}")
    wildcard_constraints:
        table="|".join(TABLES),
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        reading=lambda wildcards: shown(RESAMPLED, wildcards.table),
        n_folds=CONFIG["n_folds"],
        units=lambda wildcards: units_of(wildcards.table),
    script:
        script_path("table")


rule figure:
    input:
        sources("figure"),
        files=figure_inputs,
    output:
        expand(f"{RESULTS}/figures/{{{{figure}}}}.{{kind}}", kind=["png", "pdf"]),
    log:
        log_path("figure/{figure}"),
    benchmark:
        benchmark_path("figure/{figure}")
    wildcard_constraints:
        figure="|".join(FIGURES),
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        reading=lambda wildcards: shown(SHOWN, wildcards.figure),
        n_folds=CONFIG["n_folds"],
        units=lambda wildcards: units_of(wildcards.figure),
    script:
        script_path("figure")


rule claims:
    input:
        sources("claims"),
        evaluations=evaluations_of(UNITS),
    output:
        csv=f"{RESULTS}/claims.csv",
        md=f"{RESULTS}/claims.md",
    log:
        log_path("claims"),
    benchmark:
        benchmark_path("claims")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        reading=RESAMPLED,
        n_folds=CONFIG["n_folds"],
        units=UNITS,
    script:
        script_path("claims")


rule settings:
    input:
        all_sources(),
    output:
        configuration=f"{RESULTS}/configuration.yaml",
        provenance=f"{RESULTS}/provenance.json",
    log:
        log_path("settings"),
    benchmark:
        benchmark_path("settings")
    priority: 80
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        configuration=CONFIG,
    script:
        script_path("settings")


rule runtime:
    input:
        sources("runtime"),
        rules.settings.output,
        rules.claims.output,
        expand(rules.table.output, table=TABLES),
        expand(rules.figure.output, figure=FIGURES),
    output:
        csv=f"{RESULTS}/tables/runtime.csv",
        md=f"{RESULTS}/tables/runtime.md",
    log:
        log_path("runtime"),
    benchmark:
        benchmark_path("runtime")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        units=UNITS,
        n_folds=CONFIG["n_folds"],
    script:
        script_path("runtime")


rule report:
    input:
        sources("report"),
        rules.settings.output,
        rules.claims.output,
        rules.runtime.output,
        tables=expand(rules.table.output, table=TABLES),
        figures=expand(rules.figure.output, figure=FIGURES),
    output:
        f"{RESULTS}/report.html",
    log:
        log_path("report"),
    benchmark:
        benchmark_path("report")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    script:
        script_path("report")


rule tables:
    input:
        rules.report.input.tables,


rule figures:
    input:
        rules.report.input.figures,


# Only where somebody asks for it: the one reads a reference, the other writes one.
rule compare:
    input:
        sources("compare"),
        reference=reference_of_run,
        report=rules.report.output[0],
    log:
        log_path("compare"),
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    script:
        script_path("compare")


rule reference:
    input:
        sources("reference"),
        report=rules.report.output[0],
    log:
        log_path("reference"),
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        reference=str(REFERENCES / CONFIG["name"]),
    script:
        script_path("reference")
