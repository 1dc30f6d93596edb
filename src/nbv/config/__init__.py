"""The configuration: Hydra composes it, pydantic checks it, plain dicts hand it on."""

from nbv.config.compose import (
    equal_cost_epochs,
    load_condition,
    load_config,
    read_configuration,
)
from nbv.config.keys import default_of
from nbv.config.overrides import snakemake_overrides

__all__ = [
    "default_of",
    "equal_cost_epochs",
    "load_condition",
    "load_config",
    "read_configuration",
    "snakemake_overrides",
]
