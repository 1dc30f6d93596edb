"""Print what an extra of the project asks for, one requirement a line: extra.py NAME."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text("utf-8"))
sys.stdout.write("\n".join(project["project"]["optional-dependencies"][sys.argv[1]]) + "\n")
