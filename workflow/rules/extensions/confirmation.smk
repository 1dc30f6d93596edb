# Trainings beyond the run's own, and what all of them say together.

# What belongs to one shuffle of the folds, and to one training under it.
OF_SHUFFLE = LAYOUT.shuffle("{shuffle}")
OF_REPLICATE = LAYOUT.replicate("{shuffle}", "{replicate}")
REPLICATE = "shuffle{shuffle}_replicate{replicate}"
# What became of every choice and fusion after one training.
OF_FACTORIAL = ("objects", "beliefs", "densities")


wildcard_constraints:
    shuffle=r"\d+",
    replicate=r"\d+",
    run="[^/]+",


use rule splits as shuffle_splits with:
    output:
        OF_SHUFFLE.splits("{category}"),
    log:
        LAYOUT.log("shuffle_splits/shuffle{shuffle}/{category}"),
    benchmark:
        LAYOUT.benchmark("shuffle_splits/shuffle{shuffle}/{category}")


use rule pretrain as replicate_pretrain with:
    input:
        sources("pretrain_network"),
        splits=lambda wildcards: [
            LAYOUT.shuffle(wildcards.shuffle).splits(category)
            for category in CATEGORIES
        ],
        depth=paths(LAYOUT.depth, LOWEST_UNITS),
        objects=paths(LAYOUT.depth_objects, LOWEST_UNITS),
    output:
        OF_REPLICATE.pretrained("{fold}"),
    log:
        LAYOUT.log(f"replicate_pretrain/{REPLICATE}/fold{{fold}}"),
    benchmark:
        LAYOUT.benchmark(f"replicate_pretrain/{REPLICATE}/fold{{fold}}")


use rule replicate_pretrain as replicate_pretrain_part with:
    output:
        OF_REPLICATE.pretrained("{fold}", "{part}"),
    log:
        LAYOUT.log(f"replicate_pretrain_part/{REPLICATE}/fold{{fold}}/{{part}}"),
    benchmark:
        LAYOUT.benchmark(f"replicate_pretrain_part/{REPLICATE}/fold{{fold}}/{{part}}")


use rule train as replicate_train with:
    input:
        sources("train_estimator"),
        splits=shuffled_splits,
        depth=rules.render.output.depth,
        objects=rules.render.output.objects,
        start=replicate_start,
    output:
        **estimates_of_training(OF_REPLICATE),
        estimator=OF_REPLICATE.estimator(*FOLD),
    log:
        LAYOUT.log(f"replicate_train/{REPLICATE}/{fold_folder(*FOLD)}"),
    benchmark:
        LAYOUT.benchmark(f"replicate_train/{REPLICATE}/{fold_folder(*FOLD)}")


use rule replicate_train as replicate_train_part with:
    output:
        estimator=OF_REPLICATE.part_estimator(*FOLD, "{part}"),
    log:
        LAYOUT.log(f"replicate_train_part/{REPLICATE}/{fold_folder(*FOLD)}/{{part}}"),
    benchmark:
        LAYOUT.benchmark(
            f"replicate_train_part/{REPLICATE}/{fold_folder(*FOLD)}/{{part}}"
        )


ruleorder: replicate_train > replicate_estimate


use rule estimate as replicate_estimate with:
    input:
        sources("estimate_views"),
        splits=shuffled_splits,
        depth=rules.render.output.depth,
        objects=rules.render.output.objects,
        estimator=rules.replicate_train.output.estimator,
        of_parts=[OF_REPLICATE.part_estimator(*FOLD, part) for part in PARTS],
    output:
        **estimates_of_fold(OF_REPLICATE),
    log:
        LAYOUT.log(f"replicate_estimate/{REPLICATE}/{fold_folder(*FOLD)}"),
    benchmark:
        LAYOUT.benchmark(f"replicate_estimate/{REPLICATE}/{fold_folder(*FOLD)}")


rule keep_estimates:
    input:
        sources("keep_estimates"),
        estimates=held_out_files(Layout.estimates),
        posteriors=(
            held_out_files(Layout.posteriors) if CONFIG["gives_distributions"] else []
        ),
    output:
        LAYOUT.kept_estimates("{shuffle}", "{replicate}"),
    log:
        LAYOUT.log(f"keep_estimates/{REPLICATE}"),
    benchmark:
        LAYOUT.benchmark(f"keep_estimates/{REPLICATE}")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        held_out=held_out_keys(),
        configuration=CONFIG,
    script:
        f"{SCRIPTS}/keep_estimates.py"


rule join_kept_estimates:
    input:
        sources("join_kept_estimates"),
        kept=paths(LAYOUT.kept_estimates, TRAININGS),
    output:
        LAYOUT.all_kept_estimates,
    log:
        LAYOUT.log("join_kept_estimates"),
    benchmark:
        LAYOUT.benchmark("join_kept_estimates")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    script:
        f"{SCRIPTS}/join_kept_estimates.py"


rule evaluate_factorial:
    input:
        sources("evaluate_factorial"),
        kept=kept_file,
    output:
        **{
            name: LAYOUT.factorial(name, "{run}", "{shuffle}", "{replicate}", *UNIT)
            for name in OF_FACTORIAL
        },
    log:
        LAYOUT.log(f"evaluate_factorial/{{run}}/{REPLICATE}/{unit_folder(*UNIT)}"),
    benchmark:
        LAYOUT.benchmark(f"evaluate_factorial/{{run}}/{REPLICATE}/{unit_folder(*UNIT)}")
    # A file of kept estimates may have categories that this run has not.
    wildcard_constraints:
        category="[^/]+",
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
        runtime=per_attempt(30),
    script:
        f"{SCRIPTS}/evaluate_factorial.py"


rule statistics:
    input:
        sources("tabulate_confirmation"),
        **{name: factorial_files(name) for name in OF_FACTORIAL},
    output:
        **{
            f"{name}_{kind}": LAYOUT.confirmation(name, kind)
            for name in ("methods", "contrasts", "beliefs", "densities")
            for kind in ("csv", "md")
        },
        **{
            f"{name}_{kind}": LAYOUT.confirmation(name, kind)
            for name in ("answers", "contrasts")
            for kind in ("png", "pdf", "svg")
        },
        trainings_csv=LAYOUT.confirmation("trainings", "csv"),
    log:
        LAYOUT.log("statistics"),
    benchmark:
        LAYOUT.benchmark("statistics")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        places=lambda wildcards: statistics_places(),
        caution=CAUTION,
    script:
        f"{SCRIPTS}/tabulate_confirmation.py"


rule confirm:
    input:
        rules.join_kept_estimates.output,
        rules.statistics.output,
