# Extensions on the same estimates: each with the density that suits it best.

EXTENSION_LOOKUPS = [
    name
    for name, method in EXTENSIONS.items()
    if method["policy"] in CRITERIA and method["fusion"] != "product"
]


rule evaluate_extensions:
    input:
        sources("evaluate_extensions"),
        **estimates_of_fold(),
        splits=rules.splits.output[0],
        methods=[LAYOUT.evaluation(*FOLD, name) for name in METHODS],
    output:
        evaluations=[LAYOUT.evaluation(*FOLD, name) for name in EXTENSIONS],
        lookups=[LAYOUT.lookup(*FOLD, name) for name in EXTENSION_LOOKUPS],
        choices=LAYOUT.extension(*FOLD, "choices"),
        objects=LAYOUT.extension(*FOLD, "objects"),
        travel=LAYOUT.extension(*FOLD, "travel"),
    log:
        LAYOUT.log(f"evaluate_extensions/{fold_folder(*FOLD)}"),
    benchmark:
        LAYOUT.benchmark(f"evaluate_extensions/{fold_folder(*FOLD)}")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        methods=list(METHODS),
        extensions=EXTENSIONS,
        lookups=EXTENSION_LOOKUPS,
        density=EXTENSION_DECISION,
        seed=CONFIG["seed"],
    script:
        f"{SCRIPTS}/evaluate_extensions.py"


rule extension_evaluations:
    input:
        rules.settings.output,
        [LAYOUT.extension(*fold, "objects") for fold in folds_of(UNITS)],
