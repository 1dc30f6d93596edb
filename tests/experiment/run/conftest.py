import json
import shutil

import numpy as np
import pytest

from nbv.experiment.paper.verdicts import evaluate_claims
from nbv.experiment.report.settings import ReportSettings
from nbv.experiment.report.table import write_table
from nbv.experiment.report.tables import TABLES, build_table
from nbv.files import write_csv
from synthetic import N_FOLDS

CONFIGURATION = f"""\
experiment: synthetic
name: synthetic
n_folds: {N_FOLDS}
dataset:
  source: procedural
  root: null
estimator:
  epochs: 8
  precision: auto
"""


@pytest.fixture(scope="session")
def finished(evaluations, tmp_path_factory):
    """A run as far as it is compared or kept."""
    root = tmp_path_factory.mktemp("compare") / "synthetic"
    settings = ReportSettings(n_resamples=100)
    for name in TABLES:
        paths = {kind: root / f"tables/{name}.{kind}" for kind in ("csv", "md", "tex", "html")}
        write_table(build_table(name, evaluations, settings), paths)
    claims = evaluate_claims(evaluations, np.random.default_rng(0), 100)
    write_csv(root / "claims.csv", claims)
    (root / "claims.md").write_text("claims\n")
    (root / "configuration.yaml").write_text(CONFIGURATION)
    packages = {"numpy": "2.4.0", "torch": "2.13.0"}
    (root / "provenance.json").write_text(json.dumps({"commit": "0123", "packages": packages}))
    (root / "figures").mkdir()
    for name in ("pea.png", "figure7.png", "figure8.pdf", "figure8.png"):
        (root / "figures" / name).write_bytes(name.encode())
    for kind in ("csv", "md"):
        (root / "tables" / f"runtime.{kind}").write_text("rule,jobs\n")
    return root


@pytest.fixture
def run(finished, tmp_path):
    return shutil.copytree(finished, tmp_path / "run")
