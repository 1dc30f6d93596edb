# What each choice in the paper's method brings. Nothing is rendered or trained again.

from snakemake.utils import Paramspace

from studies.ablation import ablation_space

ABLATIONS = Paramspace(
    ablation_space(), filename_params="*", filename_sep=",", single_wildcard="setting"
)


rule evaluate_ablation:
    input:
        code=sources("evaluate_ablation"),
        calibration=paths(
            estimates_of_fold()["calibration"], PLAN.folds_of([PLAN.focus_unit])
        ),
        test=paths(estimates_of_fold()["test"], PLAN.folds_of([PLAN.focus_unit])),
    output:
        f"<results>/ablation/{ABLATIONS.wildcard_pattern}.csv",
    log:
        f"<logs>/evaluate_ablation/{ABLATIONS.wildcard_pattern}.log",
    benchmark:
        f"<benchmarks>/evaluate_ablation/{ABLATIONS.wildcard_pattern}.tsv"
    wildcard_constraints:
        setting="|".join(map(re.escape, ABLATIONS.instance_patterns)),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(1500),
    params:
        instance=ABLATIONS.instance,
        density=PLAN.decision,
        folds=list(PLAN.folds),
    script:
        "../scripts/evaluate_ablation.py"


rule ablation:
    input:
        code=sources("tabulate_ablation"),
        rows=[f"<results>/ablation/{one}.csv" for one in ABLATIONS.instance_patterns],
    output:
        csv="<results>/tables/ablation.csv",
        md="<results>/tables/ablation.md",
        tex="<results>/tables/ablation.tex",
    log:
        "<logs>/ablation.log",
    benchmark:
        "<benchmarks>/ablation.tsv"
    conda:
        ENVIRONMENT
    params:
        category=PLAN.focus,
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
        caution=PLAN.caution,
    script:
        "../scripts/tabulate_ablation.py"
