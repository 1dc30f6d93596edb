"""The configuration: Hydra composes it, pydantic checks it, plain dicts hand it on."""

from nbv.experiment.config.compose import (
    load_condition,
    load_config,
    read_configuration,
    snakemake_overrides,
)
from nbv.experiment.config.keys import default_of

__all__ = [
    "default_of",
    "load_condition",
    "load_config",
    "read_configuration",
    "snakemake_overrides",
]
