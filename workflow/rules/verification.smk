# Whether a file that somebody asks for can be of the run, and whether every file of the run is what
# was written.


rule missing:
    input:
        what_exists,
    output:
        "<results>/{missing}",
    wildcard_constraints:
        # Kept estimates may have elevations that this run does not have.
        missing=rf"(?!confirmation/).*/(?:el(?!(?:{ELEVATIONS})(?!\d))|fold(?!(?:{FOLDS})(?!\d)))\d+.*",


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
