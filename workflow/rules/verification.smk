# Whether every file of the run is what was written; run only where somebody asks for it.


rule verify:
    log:
        LAYOUT.log("verify"),
    conda:
        ENVIRONMENT
    resources:
        runtime=per_attempt(30),
    params:
        run=LAYOUT.root,
        options=[word for word in sys.argv[1:] if word != "verify"],
    script:
        f"{SCRIPTS}/verify_results.py"
