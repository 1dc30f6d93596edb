"""Train one fold's estimator of orientations, and estimate held-out views, one per orientation."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import numpy as np
    import pandas as pd
    from studies.rotation_estimator import (
        fit_orientation_temperature,
        orientations_of,
        poses_of,
        predictions,
        train_orientations,
    )
    from studies.rotations import pairs_table
    from studies.solids import SOLIDS, solid

    from nbv.core.orientations.group import ASYMMETRIC
    from nbv.core.seeds import seed_for
    from nbv.data.depth_images import open_depth
    from nbv.experiment.estimation.hardware import choose_hardware, use_one_thread
    from nbv.experiment.estimation.inference import network_outputs
    from nbv.experiment.splits import check_objects, objects_with_role, read_splits
    from nbv.files import write_csv

    params, given = snakemake.params, snakemake.input
    category, fold = snakemake.wildcards.category, int(snakemake.wildcards.fold)
    n_orientations, n_views = params.settings["turns"], params.settings["views"]
    use_one_thread()
    splits, images = read_splits(given.splits), open_depth(given.depth, given.objects)
    check_objects(splits, images.object_ids)
    orientations = {
        name: orientations_of(name, category, n_orientations, params.seed)
        for name in images.object_ids
    }
    hardware = choose_hardware(params.estimator["device"], params.estimator["precision"])
    seen = objects_with_role(splits, fold, "train")
    codes = images.of(seen)
    estimator = train_orientations(
        codes.reshape(-1, *codes.shape[2:]),
        np.concatenate([poses_of(orientations[name], n_views).reshape(-1, 3, 3) for name in seen]),
        {**params.estimator, "n_classes": params.settings["poses"]},
        hardware,
        seed_for(params.seed, "rotations", category, fold),
        params.mirror_plane_deg,
    )
    held_out = {role: objects_with_role(splits, fold, role) for role in ("calibration", "test")}
    logits, truth = {}, {}
    for role, names in held_out.items():
        outputs = network_outputs(estimator, images.of(names)[:, ::n_views], hardware)
        logits[role] = outputs.reshape(-1, outputs.shape[-1])
        truth[role] = np.concatenate(
            [poses_of(orientations[name], n_views)[:, 0] for name in names]
        )
    temperature = fit_orientation_temperature(logits["calibration"], truth["calibration"])
    symmetry = solid(category)[1] if category in SOLIDS else ASYMMETRIC
    tables = []
    for role, names in held_out.items():
        predicted = predictions(logits[role], truth[role], temperature)
        columns = {
            "role": role,
            "instance": np.repeat(names, n_orientations),
            "log_likelihood": predicted.log_likelihood,
            "error_deg": symmetry.distance_deg(predicted.estimate, truth[role]),
            "score": predicted.score,
        }
        tables.append(pairs_table(category, truth[role], predicted.estimate, columns))
    write_csv(snakemake.output[0], pd.concat(tables), decimals=6)
