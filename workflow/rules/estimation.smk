# One estimator for each fold of a unit, and its estimates for objects that it never saw.


# The network of all categories that a fold's estimators can start from, at lowest elevations.
rule pretrain:
    input:
        code=sources("pretrain_network"),
        splits=paths("<results>/splits/{category}.csv", zip(CONFIG["categories"])),
        depth=paths("<results>/depth/{category}/el{elevation}.npy", PLAN.lowest_units),
        objects=paths(
            "<results>/depth/{category}/el{elevation}_objects.json", PLAN.lowest_units
        ),
    output:
        "<results>/estimators/pretrained/fold{fold}/estimator.safetensors",
    log:
        "<logs>/pretrain/fold{fold}.log",
    benchmark:
        "<benchmarks>/pretrain/fold{fold}.tsv"
    # Everything else waits for it.
    priority: 60
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2500 + 500 * len(CONFIG["categories"])),
        runtime=per_attempt(30),
    params:
        categories=CONFIG["categories"],
        mirror_planes_deg=[PLAN.mirror_plane_deg(name) for name in CONFIG["categories"]],
        estimator=lambda wildcards: settings_of("pretraining"),
        seed=CONFIG["seed"],
    script:
        "../scripts/pretrain_network.py"


use rule pretrain as pretrain_part with:
    output:
        "<results>/estimators/pretrained/fold{fold}/without_part{part}.safetensors",
    log:
        "<logs>/pretrain_part/fold{fold}/{part}.log",
    benchmark:
        "<benchmarks>/pretrain_part/fold{fold}/{part}.tsv"


# It estimates, too, what its estimator has not seen: a job of its own would load torch once more.
rule train:
    input:
        code=sources("train_estimator"),
        splits="<results>/splits/{category}.csv",
        depth="<results>/depth/{category}/el{elevation}.npy",
        objects="<results>/depth/{category}/el{elevation}_objects.json",
        start=training_start,
    output:
        **estimates_of_training(),
        estimator="<results>/estimators/{category}/el{elevation}/fold{fold}/estimator.safetensors",
    log:
        "<logs>/train/{category}/el{elevation}/fold{fold}.log",
    benchmark:
        "<benchmarks>/train/{category}/el{elevation}/fold{fold}.tsv"
    wildcard_constraints:
        fold=folds_if(not PLAN.linear),
    # Longest jobs first: short ones fill the gaps at the end, when cores would stand idle.
    priority: 50
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2500),
        runtime=per_attempt(30),
    params:
        estimator=stage_of,
        mirror_plane_deg=lambda wildcards: PLAN.mirror_plane_deg(wildcards.category),
        seed=CONFIG["seed"],
    script:
        "../scripts/train_estimator.py"


# One estimator for each part: it trains on all other parts, and its part calibrates it.
use rule train as train_part with:
    output:
        estimator="<results>/estimators/{category}/el{elevation}/fold{fold}/without_part{part}.safetensors",
    log:
        "<logs>/train_part/{category}/el{elevation}/fold{fold}/{part}.log",
    benchmark:
        "<benchmarks>/train_part/{category}/el{elevation}/fold{fold}/{part}.tsv"


# A job of its own where another program estimated, and where calibration is cross-fitted: several
# estimators answer for a fold.
ESTIMATE = "take_estimates" if PLAN.external else "estimate_views"
# Columns of probabilities take ten times as much in memory as in the file.
PAIRS_MB = (
    Path(CONFIG["estimator"]["pairs"]).stat().st_size // 10**6 if PLAN.external else 0
)


rule estimate:
    input:
        unpack(estimated_from),
        code=sources(ESTIMATE),
    output:
        **estimates_of_fold(),
    log:
        "<logs>/estimate/{category}/el{elevation}/fold{fold}.log",
    benchmark:
        "<benchmarks>/estimate/{category}/el{elevation}/fold{fold}.tsv"
    wildcard_constraints:
        fold=folds_if(PLAN.estimates_apart),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000 + 12 * PAIRS_MB),
    params:
        device=CONFIG["estimator"].get("device"),
        precision=CONFIG["estimator"].get("precision"),
    script:
        f"../scripts/{ESTIMATE}.py"


rule estimators:
    input:
        paths(
            "<results>/estimators/{category}/el{elevation}/fold{fold}/estimator.safetensors",
            PLAN.folds_of(UNITS),
        ),


rule estimates:
    input:
        [
            path
            for role in ESTIMATED_ROLES
            for path in paths(estimates_of_fold()[role], PLAN.folds_of(UNITS))
        ],


if PLAN.linear:

    include: "linear.smk"
