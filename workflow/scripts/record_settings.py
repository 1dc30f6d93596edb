"""Write down what the results were made with: configuration, commit and versions."""

from nbv.jobs import job

with job(snakemake):
    from omegaconf import OmegaConf

    from nbv.files import write_json, write_text
    from nbv.provenance import git_commit, versions

    write_text(snakemake.output.configuration, OmegaConf.to_yaml(snakemake.params.configuration))
    write_json(snakemake.output.provenance, {"commit": git_commit()} | versions())
