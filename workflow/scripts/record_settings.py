"""Record the configuration, commit and versions that made the results."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from omegaconf import OmegaConf

    from nbv.experiment.run.provenance import git_commit, versions
    from nbv.files import write_json, write_text

    write_text(snakemake.output.configuration, OmegaConf.to_yaml(snakemake.params.configuration))
    write_json(snakemake.output.provenance, {"commit": git_commit()} | versions())
