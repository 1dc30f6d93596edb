# What each choice in the paper's method brings. Nothing is rendered or trained again.

from snakemake.utils import Paramspace

from studies.ablation import ablation_space

ABLATIONS = Paramspace(
    ablation_space(), filename_params="*", filename_sep=",", single_wildcard="setting"
)


rule evaluate_ablation:
    input:
        sources("evaluate_ablation"),
        calibration=[
            LAYOUT.estimates(*fold, "calibration") for fold in folds_of([FOCUS_UNIT])
        ],
        test=[LAYOUT.estimates(*fold, "test") for fold in folds_of([FOCUS_UNIT])],
    output:
        LAYOUT.ablation(ABLATIONS.wildcard_pattern),
    log:
        LAYOUT.log(f"evaluate_ablation/{ABLATIONS.wildcard_pattern}"),
    benchmark:
        LAYOUT.benchmark(f"evaluate_ablation/{ABLATIONS.wildcard_pattern}")
    wildcard_constraints:
        setting="|".join(map(re.escape, ABLATIONS.instance_patterns)),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(1500),
    params:
        instance=ABLATIONS.instance,
        density=DECISION,
        folds=list(FOLDS),
    script:
        f"{SCRIPTS}/evaluate_ablation.py"


rule ablation:
    input:
        sources("tabulate_ablation"),
        rows=[LAYOUT.ablation(setting) for setting in ABLATIONS.instance_patterns],
    output:
        csv=LAYOUT.table("ablation", "csv"),
        md=LAYOUT.table("ablation", "md"),
        tex=LAYOUT.table("ablation", "tex"),
    log:
        LAYOUT.log("ablation"),
    benchmark:
        LAYOUT.benchmark("ablation")
    conda:
        ENVIRONMENT
    params:
        category=FOCUS,
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
        caution=CAUTION,
    script:
        f"{SCRIPTS}/tabulate_ablation.py"
