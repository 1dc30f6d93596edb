"""Evaluate the plans that other trainings pick, on the test objects of one unit."""

from nbv.experiment.jobs import job

with job(snakemake):
    from nbv.experiment.plan_bound import plan_bounds
    from studies.kept_estimates import kept_settings, read_kept

    from nbv.files import write_csv

    wildcards, path = snakemake.wildcards, snakemake.input.kept
    settings, keys = kept_settings(path)
    unit = wildcards.category, int(wildcards.elevation)
    held = read_kept(path, [key for key in keys if key[2:4] == unit and key[5] == "test"])
    more_views = settings["more_views"]
    made = plan_bounds(held, more_views["n_views"], more_views["min_separation_deg"])
    write_csv(snakemake.output[0], made)
