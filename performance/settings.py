"""The project's default configuration, which the benchmarks measure."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from nbv.experiment.config import load_config


@cache
def configuration() -> dict[str, Any]:
    return load_config(Path(__file__).parents[1] / "config", [])
