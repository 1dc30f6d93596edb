# Whether every file of the run is what was written; run only where somebody asks for it.


rule verify:
    log:
        "<logs>/verify.log",
    conda:
        ENVIRONMENT
    resources:
        runtime=per_attempt(30),
    params:
        run=PLAN.results,
        options=[word for word in sys.argv[1:] if word != "verify"],
    script:
        "../scripts/verify_results.py"
