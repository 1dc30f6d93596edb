"""One category of the paper's run and the studies of its methods, for all tests of this folder."""

from functools import partial

import pytest
from snakemake.utils import Paramspace
from studies.ablation import ablation_space

from projects import MUGS, STUDIES, Project, copy_run, finished_project

# A job of every kind.
PAPER = (
    "evaluation",
    *(f"results/tiny/{name}" for name in ("claims.md", "tables/table1.md", "figures/figure2.png")),
)
STUDIED = (
    *MUGS,
    "transfer.folds=[2]",
    "~transfer.conditions.stereo",
    "~transfer.conditions.axis",
    "rotations.turns=4",
    "rotations.views=3",
    "rotations.poses=60",
)
_SETTINGS = Paramspace(ablation_space(), filename_params="*", filename_sep=",").instance_patterns
# The paper's own choices.
ABLATION = f"results/tiny/ablation/{next(iter(_SETTINGS))}.csv"
CUBE = "results/tiny/rotations/cube/fold1/pairs.csv"


@pytest.fixture(scope="session")
def evaluated(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A project after the paper's run on mugs. Not to be changed."""
    return finished_project(tmp_path_factory, "evaluated", *PAPER, overrides=MUGS)


@pytest.fixture(scope="session")
def studied(evaluated: Project, tmp_path_factory: pytest.TempPathFactory) -> Project:
    """The evaluated project after the studies of its estimates. Not to be changed."""

    targets = ("extensions", "transfer", "rotations", ABLATION, CUBE)
    return finished_project(
        tmp_path_factory,
        "studied",
        *STUDIES,
        *targets,
        overrides=STUDIED,
        prepare=partial(copy_run, evaluated),
    )
