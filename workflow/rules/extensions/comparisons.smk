# Tables that compare this run with finished ones. They are made only where somebody asks for them.

rule run_comparison:
    input:
        sources("tabulate_run_comparison"),
        evaluations=compared(Layout.evaluation, methods_in),
    output:
        csv=LAYOUT.table("run_comparison", "csv"),
        md=LAYOUT.table("run_comparison", "md"),
        tex=LAYOUT.table("run_comparison", "tex"),
    log:
        LAYOUT.log("run_comparison"),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(1000),
        runtime=per_attempt(10),
    params:
        evaluations=lambda wildcards: compared_keys(methods_in),
        settings=RESAMPLED,
        caution=CAUTION,
    script:
        f"{SCRIPTS}/tabulate_run_comparison.py"


rule estimator_comparison:
    input:
        sources("tabulate_estimator_comparison"),
        estimates=compared(Layout.estimates, estimated_roles, UNITS),
    output:
        csv=LAYOUT.table("estimator_comparison", "csv"),
        md=LAYOUT.table("estimator_comparison", "md"),
        tex=LAYOUT.table("estimator_comparison", "tex"),
    log:
        LAYOUT.log("estimator_comparison"),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
        runtime=per_attempt(10),
    params:
        estimates=lambda wildcards: compared_keys(estimated_roles, UNITS),
        settings=RESAMPLED,
        caution=CAUTION,
    script:
        f"{SCRIPTS}/tabulate_estimator_comparison.py"
