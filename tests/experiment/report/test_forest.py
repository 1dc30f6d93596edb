import numpy as np
import pytest

from nbv.experiment.paper.claims import CLAIMS
from nbv.experiment.paper.verdicts import evaluate_claims
from nbv.experiment.report.forest import claim_figure, claims_forest, comparisons_of, table_picture
from nbv.experiment.report.settings import ReportSettings
from nbv.experiment.report.tables import build_table
from nbv.labels import method_label
from nbv.style import AGAINST, FOR, OPEN

CLAIM = {claim.id: claim for claim in CLAIMS}
MARKS = {"holds": (FOR, "o"), "undecided": (OPEN, "s"), "does not hold": (AGAINST, "X")}


@pytest.fixture(scope="module")
def judged(evaluations):
    return evaluate_claims(evaluations, np.random.default_rng(0), 200)


@pytest.fixture(scope="module")
def rows(judged):
    return comparisons_of(judged)


def marks(axes):
    return [line for line in axes.lines if line.get_marker() not in ("None", "", None)]


def texts(artists):
    return [text.get_text() for text in artists]


def test_every_claim_that_was_run_has_one_mark_by_its_verdict(judged):
    (axes,) = claims_forest(judged).axes
    run = judged[judged["verdict"] != "not run"].drop_duplicates("id").set_index("id")
    labels = texts(axes.get_yticklabels())
    assert len(marks(axes)) == len(run) > 3
    for mark in marks(axes):
        title = labels[round(float(np.asarray(mark.get_ydata())[0]))]
        (claim,) = (claim for claim in CLAIMS if claim.title == title)
        assert (mark.get_color(), mark.get_marker()) == MARKS[run.loc[claim.id, "verdict"]]


def test_a_difference_a_hundred_times_as_large_leaves_the_others_apart_from_0(judged):
    decided = judged["verdict"].isin(["holds", "does not hold"]) & judged["ci_low"].notna()
    size = np.where(judged["id"] == judged["id"][decided].iloc[0], 50.0, 0.5)
    columns = ["difference", "ci_low", "ci_high"]
    changed = judged.assign(**{name: np.sign(judged[name]) * size for name in columns})
    (axes,) = claims_forest(changed).axes
    width = np.ptp(axes.transAxes.transform([[0, 0], [1, 0]])[:, 0])
    zero = axes.transData.transform((0, 0))[0]
    values = {float(np.asarray(mark.get_xdata())[0]) for mark in marks(axes)}
    places = [axes.transData.transform((value, 0))[0] for value in values if value]
    assert max(values) > 90 * min(abs(value) for value in values if value)
    assert min(abs(place - zero) for place in places) > 0.05 * width


def test_claims_have_short_titles_of_their_own():
    titles = [claim.title for claim in CLAIMS]
    assert len(set(titles)) == len(titles)
    assert all(0 < len(title) <= 32 for title in titles)


def test_a_claims_picture_shows_every_difference_and_the_papers(judged, rows):
    """The claim compares Proposed with each method at one place."""
    claim = CLAIM["examples"]
    (axes,) = claim_figure(claim, rows[claim.id]).axes
    found = judged[judged["id"] == claim.id]
    shown = [float(np.asarray(mark.get_xdata())[0]) for mark in marks(axes)]
    assert shown == pytest.approx(found["difference"].tolist())
    assert texts(axes.get_yticklabels()) == [
        f"Proposed − {method_label(method)}" for method in ("single", "random", "opposite")
    ]
    assert "below 0: the first is better" in axes.get_xlabel()


def test_published_differences_are_open_marks(rows, judged):
    claim = CLAIM["hidden-range"]
    (axes,) = claim_figure(claim, rows[claim.id]).axes
    ours, published = marks(axes)
    row = judged[judged["id"] == claim.id].iloc[0]
    assert published.get_markerfacecolor() == "none"
    expected = row["published_value"] - row["published_versus_value"]
    assert float(published.get_xdata()[0]) == pytest.approx(expected)
    assert ours.get_markerfacecolor() != "none"


def test_mirrored_comparisons_are_drawn_once(rows):
    claim = CLAIM["sigma-mae"]
    (axes,) = claim_figure(claim, rows[claim.id]).axes
    assert len(rows[claim.id]) == 6
    filled = [mark for mark in marks(axes) if mark.get_markerfacecolor() != "none"]
    assert len(filled) == len(axes.get_yticklabels()) == 3


def test_each_claim_that_was_run_can_be_drawn_with_its_text_inside(rows):
    for name, found in rows.items():
        figure = claim_figure(CLAIM[name], found)
        figure.draw_without_rendering()
        (axes,) = figure.axes
        for artist in (axes.xaxis.label, *figure.legends):
            box = artist.get_window_extent()
            assert box.x0 >= -1, name
            assert box.x1 <= figure.bbox.width + 1, name
            assert box.y0 >= -1, name


def test_the_picture_of_table_1_shows_its_cells(evaluations):
    cells = build_table("table1", evaluations, ReportSettings(n_resamples=50)).cells
    (axes,) = table_picture(cells).axes
    shown = cells[cells["metric"] == "mae"]
    labels = texts(axes.get_yticklabels())
    assert labels == ["Mug", "Single", "Random", "Opposite", "Proposed",
                      "Chair", "Single", "Random", "Opposite", "Proposed"]  # fmt: skip
    filled = [mark for mark in marks(axes) if mark.get_markerfacecolor() != "none"]
    opened = [mark for mark in marks(axes) if mark.get_markerfacecolor() == "none"]
    for drawn, column in ((filled, "value"), (opened, "published")):
        values = [float(np.asarray(mark.get_xdata())[0]) for mark in drawn]
        assert values == pytest.approx(shown[column].tolist())
    ends = [list(line.get_xdata()) for line in axes.lines if len(line.get_xdata()) == 2]
    assert np.ravel(ends) == pytest.approx(shown[["ci_low", "ci_high"]].to_numpy().ravel())
    assert "degrees" in axes.get_xlabel()


@pytest.mark.parametrize("side", [-1, 1])
def test_the_share_of_outliers_is_not_cut_off(judged, side):
    """Wherever the differences of the other claims lie."""
    shifted = judged.copy()
    for name in ("difference", "ci_low", "ci_high"):
        shifted[name] = side * np.abs(shifted[name]) * 10
    for changed in (judged, shifted):
        figure = claims_forest(changed)
        figure.draw_without_rendering()
        (text,) = figure.axes[0].texts
        box, whole = text.get_window_extent(), figure.bbox
        assert whole.x0 <= box.x0 < box.x1 <= whole.x1
