"""Train the network of the depth features on objects that no experiment has."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import json
    from pathlib import Path

    import torch

    from nbv.core.seeds import seed_for
    from nbv.data.depth_images import open_depth
    from nbv.experiment.estimation.features_network import save_features, train_features
    from nbv.experiment.estimation.hardware import choose_hardware, use_one_thread

    params, given = snakemake.params, snakemake.input
    use_one_thread()
    # This job may take all cores: it runs alone.
    torch.set_num_threads(snakemake.threads)
    trained = train_features(
        [open_depth(*paths) for paths in zip(given.depth, given.objects, strict=True)],
        [category for category, _ in params.units],
        params.configuration["mirror_plane_deg"],
        params.estimator,
        choose_hardware(params.estimator["device"], params.estimator["precision"]),
        seed_for(params.configuration["seed"], "features"),
    )
    made_with = json.loads(Path(given.provenance).read_text(encoding="utf-8"))
    save_features(
        snakemake.output[0],
        trained,
        made_with | {"settings": params.configuration, "n_azimuths": params.n_azimuths},
    )
