"""How many wrong answers on other objects are unfamiliar: `tools/other_objects.py` and the page."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "docs/reference/bundles/unfamiliar.csv"
LINES = {
    "given to the network": "answered",
    "called unfamiliar": "unfamiliar",
    "wrong by more than 45°": "wrong",
    "of these, called unfamiliar": "wrong_unfamiliar",
}


@pytest.fixture(scope="module")
def kept() -> pd.DataFrame:
    return pd.read_csv(KEPT).set_index(["training", "category"])


def test_the_page_has_the_shares_of_the_trainings(kept: pd.DataFrame) -> None:
    page = (ROOT / "docs/bundles.md").read_text(encoding="utf-8")
    categories = ["airplane", "car", "chair", "toilet", "mug"]
    for line, column in LINES.items():
        cells = " | ".join(str(n) for n in kept.loc[0, column].loc[categories])
        assert f"| {line} | {cells} |" in page
    other = kept.drop("mug", level="category").groupby("training").sum()
    share = (100 * other["wrong_unfamiliar"] / other["wrong"]).round().astype(int)
    wrong, caught = other.loc[0, ["wrong", "wrong_unfamiliar"]]
    assert f"{caught} of {wrong} wrong answers on other objects ({share[0]} %)" in page
    assert f"{share[1:].min()} to {share[1:].max()} % with seeds 1 to 3" in page


@pytest.mark.slow
def test_the_shipped_bundle_has_the_kept_counts(kept: pd.DataFrame, monkeypatch, capsys) -> None:
    """On another processor, sums in another order may change an answer that is near a limit."""
    spec = importlib.util.spec_from_file_location("other", ROOT / "tools/other_objects.py")
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    monkeypatch.setattr("sys.argv", ["other_objects.py", "mug"])
    tool.main()
    header, *lines = capsys.readouterr().out.splitlines()
    assert header.split(",") == ["training", *kept.reset_index().columns[1:]]
    for line in lines:
        _, category, *counts = line.split(",")
        assert [int(n) for n in counts] == pytest.approx(kept.loc[0, category].tolist(), abs=2)
