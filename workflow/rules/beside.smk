# Tables that show finished runs beside this one. Made only where somebody asks for them.


rule likelihoods:
    input:
        sources("likelihoods"),
        files=lambda wildcards: files_of_runs(likelihood_files),
    output:
        csv=f"{RESULTS}/tables/likelihoods.csv",
        md=f"{RESULTS}/tables/likelihoods.md",
    log:
        log_path("likelihoods"),
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        runs=lambda wildcards: {
            name: has_posteriors(run) for name, run in runs_beside().items()
        },
        units=REFERENCE_UNITS,
        n_folds=CONFIG["n_folds"],
        reading=RESAMPLED,
    script:
        script_path("likelihoods")


rule sidebyside:
    input:
        sources("sidebyside"),
        files=lambda wildcards: files_of_runs(evaluation_files),
    output:
        csv=f"{RESULTS}/tables/sidebyside.csv",
        md=f"{RESULTS}/tables/sidebyside.md",
    log:
        log_path("sidebyside"),
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        runs=lambda wildcards: {
            name: evaluated(run) for name, run in runs_beside().items()
        },
        units=REFERENCE_UNITS,
        n_folds=CONFIG["n_folds"],
        reading=RESAMPLED,
    script:
        script_path("sidebyside")
