"""Extensions and the ablation, on the estimates of the paper's run."""

import pandas as pd
import pytest

from .conftest import ABLATION

pytestmark = pytest.mark.slow


def test_extensions_are_made_and_leave_the_paper_alone(evaluated, studied):
    before, after = evaluated.outcome(), studied.outcome()
    assert {name: after[name] for name in before} == before
    tables = studied.results / "tables"
    for name in ("leaderboard", "more_views"):
        for kind in ("csv", "md", "tex"):
            assert (tables / f"{name}.{kind}").stat().st_size > 100
    for name in ("more_views", "travel"):
        assert (studied.results / f"figures/{name}.png").stat().st_size > 1000
    board = pd.read_csv(tables / "leaderboard.csv")
    assert {"single", "proposed", "selected", "oracle_posterior"} <= set(board["method"])
    (mine,) = board.loc[board["method"] == "proposed", "value"]
    found = studied.results.glob("evaluation/mug/el00/*/proposed.csv")
    errors = pd.concat(pd.read_csv(path) for path in found)
    assert abs(mine - errors["error_deg"].mean()) < 1e-3


def test_the_ablation_of_nothing_has_the_errors_of_the_paper(studied):
    found = pd.read_csv(studied.folder / ABLATION)
    plain = pd.concat(
        pd.read_csv(path).assign(fold=fold)
        for fold in (1, 2)
        for path in studied.results.glob(f"evaluation/mug/el00/fold{fold}/proposed.csv")
    )
    expected = plain.groupby(["fold", "object_id"])["error_deg"].mean().to_numpy()
    mine = found.sort_values(["fold", "object_id"])["error_deg"]
    assert abs(mine.to_numpy() - expected).max() < 1e-3
