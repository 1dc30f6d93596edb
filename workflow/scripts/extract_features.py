"""Compute the depth features of every image of one category at one elevation."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.data.depth_images import open_depth
    from nbv.experiment.estimation.features import Features
    from nbv.files import write_rows

    features = Features.load()
    images = open_depth(snakemake.input.depth, snakemake.input.objects)
    extract = features.of_both if snakemake.params.mirrored else features.of
    n_features = features.n_features * (2 if snakemake.params.mirrored else 1)
    # Half precision: its steps are a thousandth of a feature.
    write_rows(
        snakemake.output[0],
        (extract(np.asarray(codes)) for codes in images.codes),
        (*images.codes.shape[:2], n_features),
        np.float16,
    )
