# What each choice in the method is worth: nothing is rendered or trained again.

from snakemake.utils import Paramspace

from nbv.experiments.ablation import ablation_space

ABLATIONS = Paramspace(
    ablation_space(), filename_params="*", filename_sep=",", single_wildcard="setting"
)


rule ablate:
    input:
        sources("ablate"),
        calibration=of_ablated(rules.estimate.output.calibration),
        test=of_ablated(rules.estimate.output.test),
    output:
        f"{RESULTS}/ablation/{ABLATIONS.wildcard_pattern}.csv",
    log:
        log_path(f"ablate/{ABLATIONS.wildcard_pattern}"),
    benchmark:
        benchmark_path(f"ablate/{ABLATIONS.wildcard_pattern}")
    wildcard_constraints:
        setting="[^/]+",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        instance=ABLATIONS.instance,
        density=DECISION,
        folds=list(FOLDS),
    script:
        script_path("ablate")


rule ablation:
    input:
        sources("ablation"),
        found=expand(
            f"{RESULTS}/ablation/{{setting}}.csv", setting=ABLATIONS.instance_patterns
        ),
    output:
        expand(f"{RESULTS}/tables/ablation.{{kind}}", kind=["csv", "md", "tex"]),
    log:
        log_path("ablation"),
    benchmark:
        benchmark_path("ablation")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        category=ABLATED[0],
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
    script:
        script_path("ablation")
