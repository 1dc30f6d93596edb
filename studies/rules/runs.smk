# This run and finished ones side by side. The table is made only where somebody asks for it.


rule runs:
    input:
        code=sources("tabulate_runs"),
        estimates=lambda wildcards: compared_files("estimates"),
        evaluations=lambda wildcards: compared_files("evaluation"),
    output:
        csv="<results>/tables/runs.csv",
        md="<results>/tables/runs.md",
        tex="<results>/tables/runs.tex",
    log:
        "<logs>/runs.log",
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
        runtime=per_attempt(10),
    params:
        estimates=lambda wildcards: compared_keys("estimates"),
        evaluations=lambda wildcards: compared_keys("evaluation"),
        settings=PLAN.resampled,
        caution=PLAN.caution,
    script:
        "../scripts/tabulate_runs.py"
