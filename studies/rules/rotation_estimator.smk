# An estimator of rotations in three dimensions for each category and fold, and for solids of exact
# symmetry. The study `rotations` is about them where no table of pairs is given.

SHAPES = "|".join([*map(re.escape, CONFIG["categories"]), *SOLIDS])
ROTATION_VIEWS = {key: CONFIG["rotations"][key] for key in ("turns", "views")}


rule make_solid:
    input:
        code=sources("make_solid"),
    output:
        f"{OWN}/meshes.npz",
    log:
        "<logs>/make_solid/{category}.log",
    benchmark:
        "<benchmarks>/make_solid/{category}.tsv"
    wildcard_constraints:
        category="|".join(SOLIDS),
    conda:
        ENVIRONMENT
    params:
        n_objects=CONFIG["n_objects"] or 125,
    script:
        "../scripts/make_solid.py"


use rule splits from paper as solid_splits with:
    input:
        code=sources("split_objects"),
        meshes=f"{OWN}/meshes.npz",
    output:
        f"{OWN}/splits.csv",
    log:
        "<logs>/solid_splits/{category}.log",
    benchmark:
        "<benchmarks>/solid_splits/{category}.tsv"
    wildcard_constraints:
        category="|".join(SOLIDS),


rule render_rotations:
    input:
        code=sources("render_rotations"),
        meshes=shape_file("meshes.npz"),
    output:
        depth=f"{OWN}/depth.npy",
        objects=f"{OWN}/objects.json",
    log:
        "<logs>/render_rotations/{category}.log",
    benchmark:
        "<benchmarks>/render_rotations/{category}.tsv"
    wildcard_constraints:
        category=SHAPES,
    conda:
        ENVIRONMENT
    resources:
        runtime=per_attempt(30),
    params:
        renderer=CONFIG["renderer"],
        camera=CONFIG["camera"],
        settings=ROTATION_VIEWS,
        seed=CONFIG["seed"],
    script:
        "../scripts/render_rotations.py"


rule estimate_rotations:
    input:
        code=sources("estimate_rotations"),
        splits=shape_file("splits.csv"),
        depth=f"{OWN}/depth.npy",
        objects=f"{OWN}/objects.json",
    output:
        f"{OWN_FOLD}/pairs.csv",
    log:
        "<logs>/estimate_rotations/{category}/fold{fold}.log",
    benchmark:
        "<benchmarks>/estimate_rotations/{category}/fold{fold}.tsv"
    wildcard_constraints:
        category=SHAPES,
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(3000),
        runtime=per_attempt(60),
    params:
        estimator=CONFIG["estimator"],
        settings=ROTATION_VIEWS | {"poses": CONFIG["rotations"]["poses"]},
        mirror_plane_deg=lambda wildcards: PLAN.mirror_plane_deg(wildcards.category),
        seed=CONFIG["seed"],
    script:
        "../scripts/estimate_rotations.py"


rule rotation_estimator:
    input:
        code=sources("tabulate_rotation_estimator"),
        pairs=rotation_pairs,
    output:
        csv="<results>/tables/rotation_estimator.csv",
        md="<results>/tables/rotation_estimator.md",
    log:
        "<logs>/rotation_estimator.log",
    benchmark:
        "<benchmarks>/rotation_estimator.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        poses=CONFIG["rotations"]["poses"],
    script:
        "../scripts/tabulate_rotation_estimator.py"


use rule evaluate_rotations as evaluate_own_rotations with:
    input:
        code=sources("evaluate_rotations"),
        pairs=f"{OWN_FOLD}/pairs.csv",
        models_info=[],
    output:
        f"{OWN_FOLD}/walks.csv",
    log:
        "<logs>/evaluate_own_rotations/{category}/fold{fold}.log",
    benchmark:
        "<benchmarks>/evaluate_own_rotations/{category}/fold{fold}.tsv"
