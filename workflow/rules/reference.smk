# Reference results under version control: one rule compares a run with them, one makes them.
# Both run only where somebody asks for them.


rule compare:
    input:
        code=sources("compare_with_reference"),
        reference=reference_of_run,
        report="<results>/report.html",
    log:
        "<logs>/compare.log",
    conda:
        ENVIRONMENT
    params:
        run=lambda wildcards, input: str(Path(input.report).parent),
    script:
        "../scripts/compare_with_reference.py"


rule reference:
    input:
        code=sources("keep_reference"),
        report="<results>/report.html",
    log:
        "<logs>/reference.log",
    conda:
        ENVIRONMENT
    params:
        run=lambda wildcards, input: str(Path(input.report).parent),
        reference=str(REFERENCES / CONFIG["name"]),
    script:
        "../scripts/keep_reference.py"
