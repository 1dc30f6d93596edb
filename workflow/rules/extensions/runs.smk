# This run and finished ones side by side. The table is made only where somebody asks for it.


rule runs:
    input:
        sources("tabulate_runs"),
        estimates=compared(Layout.estimates, compared_roles),
        evaluations=compared(Layout.evaluation, two_view_methods),
    output:
        csv=LAYOUT.table("runs", "csv"),
        md=LAYOUT.table("runs", "md"),
        tex=LAYOUT.table("runs", "tex"),
    log:
        LAYOUT.log("runs"),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
        runtime=per_attempt(10),
    params:
        estimates=lambda wildcards: compared_keys(compared_roles),
        evaluations=lambda wildcards: compared_keys(two_view_methods),
        settings=RESAMPLED,
        caution=CAUTION,
    script:
        f"{SCRIPTS}/tabulate_runs.py"
