import numpy as np
import pandas as pd
import pytest

from claim_frames import MUG, term, unit, verdict_of
from nbv.errors import UserError
from nbv.experiment.paper.claims import CATEGORIES, CLAIMS, ranked
from nbv.experiment.paper.statements import (
    FAILS,
    HOLDS,
    NOT_RUN,
    UNDECIDED,
    Better,
    Claim,
    Comparable,
    FreeOfOutliers,
    Term,
)
from nbv.experiment.paper.verdicts import evaluate_claims, read_claims
from nbv.experiment.report.settings import ReportSettings
from nbv.experiment.report.tables import build_table
from nbv.files import write_csv


@pytest.mark.parametrize(
    ("proposed", "noise", "expected"),
    [(7.0, 0.5, HOLDS), (12.0, 0.5, FAILS), (10.0, 3.0, UNDECIDED)],
)
def test_a_comparison_is_won_lost_or_open(proposed, noise, expected):
    frame = unit({"proposed": proposed, "opposite": 10.0}, noise)
    statement = Better("mae", term("proposed"), term("opposite"))
    assert verdict_of(statement, {MUG: frame}) == expected
    pauc = Better("pauc", term("proposed"), term("opposite"))
    assert verdict_of(pauc, {MUG: frame}) == expected
    median = Better("median", term("proposed"), term("opposite"))
    assert verdict_of(median, {MUG: frame}) == expected


def test_comparable_needs_the_whole_interval_inside_the_margin():
    close = unit({"proposed": 10.0, "opposite": 10.2}, 0.5)
    apart = unit({"proposed": 10.0, "opposite": 14.0}, 0.5)
    loose = unit({"proposed": 10.0, "opposite": 10.2}, 6.0)
    statement = Comparable("mae", term("proposed"), term("opposite"), 1.0)
    verdicts = [verdict_of(statement, {MUG: frame}) for frame in (close, apart, loose)]
    assert verdicts == [HOLDS, FAILS, UNDECIDED]


def test_ranks_are_exact():
    frame = unit({"single": 12.0, "random": 10.0, "opposite": 6.0, "proposed": 8.0}, 0.3)
    verdicts = [
        verdict_of(ranked("mae", term("proposed"), rank), {MUG: frame}) for rank in (1, 2, 3)
    ]
    assert verdicts == [FAILS, HOLDS, FAILS]


def test_outliers_follow_tukeys_rule():
    frame = unit({"proposed": 10.0}, 0.3)
    tail = frame.copy()
    tail.loc[0, "error_deg"] = 170.0
    assert verdict_of(FreeOfOutliers(term("proposed")), {MUG: tail}) == FAILS
    flat = frame.assign(error_deg=np.linspace(5, 6, len(frame)))
    assert verdict_of(FreeOfOutliers(term("proposed")), {MUG: flat}) == HOLDS


def test_groups_folds_and_azimuths_select_images():
    frame = unit({"single": 10.0, "proposed": 10.0}, 0.3)
    better = frame["method"] == "proposed"
    hidden = better & frame["initial_deg"].between(45, 134)
    frame.loc[hidden, "error_deg"] -= 5
    for group, expected in ((2, HOLDS), (4, UNDECIDED)):
        a, b = term("proposed", group=group), term("single", group=group)
        found = evaluate_claims(
            {MUG: frame},
            np.random.default_rng(0),
            500,
            [Claim("g", "3", "", "", Better("mae", a, b))],
        ).iloc[0]
        assert found["difference"] == pytest.approx(-5 if group == 2 else 0, abs=0.6)
        assert (found["verdict"] == HOLDS) == (expected == HOLDS)
    a, b = (term(m, initial_deg=(90, 100)) for m in ("proposed", "single"))
    assert verdict_of(Better("mae", a, b), {MUG: frame}) == HOLDS


def test_what_was_not_run_is_reported_as_such(evaluations, rng):
    found = evaluate_claims(evaluations, rng, 200).drop_duplicates("id").set_index("id")["verdict"]
    for name in ("mae-75-comparable", "median-airplane", "outperforms-all", "mae-elevations"):
        assert found[name] == NOT_RUN
    assert found["hidden-range"] == HOLDS
    nothing = evaluate_claims({}, rng, 10)
    assert set(nothing["verdict"]) == {NOT_RUN}


def test_claims_and_tables_state_the_same_intervals(evaluations):
    claims = evaluate_claims(evaluations, np.random.default_rng(3), 300)
    part = claims.query(
        "id == 'mae-75-opposite' and subject == 'Proposed (Mug 0°)' and statistic == 'mae'"
    ).iloc[0]
    table = build_table("table2", evaluations, ReportSettings(n_resamples=300, seed=3))
    row = table.cells.query("row == '0' and method == 'proposed'").iloc[0]
    assert (part["difference"], part["ci_low"], part["ci_high"]) == pytest.approx(
        (row["difference"], row["difference_low"], row["difference_high"])
    )


def test_elevations_are_compared_on_the_same_objects():
    low = unit({"single": 10.0}, noise=4.0, seed=1)
    high = low.assign(error_deg=low["error_deg"] - 0.5)
    a, b = Term("single", (("mug", 75),)), Term("single", (MUG,))
    # The objects differ far more than the elevations: only the pairing can show the half degree.
    assert verdict_of(Better("mae", a, b), {("mug", 75): high, MUG: low}) == HOLDS


@pytest.mark.parametrize("n_objects", [1, 4, 5])
def test_fewer_than_five_objects_decide_nothing(n_objects):
    frame = unit({"proposed": 4.0, "opposite": 10.0}, 0.1, n_objects=n_objects)
    a, b = term("proposed"), term("opposite")
    decided = n_objects == 5
    for statement, verdict in (
        (Better("mae", a, b), HOLDS),
        (Better("median", b, a), FAILS),
        (Comparable("mae", a, b, 1.0), FAILS),
        (FreeOfOutliers(a), HOLDS),
    ):
        claim = Claim("few", "3", "s", "c", statement)
        found = evaluate_claims({MUG: frame}, np.random.default_rng(0), 200, [claim]).iloc[0]
        assert found["verdict"] == (verdict if decided else UNDECIDED)
        assert found["point_verdict"] == verdict
    absent = Better("mae", a, term("single"))
    assert verdict_of(absent, {MUG: frame}) == NOT_RUN


def test_sigma_needs_five_objects_in_each_fold():
    a, b = term("proposed"), term("opposite")
    for n_objects, expected in ((25, HOLDS), (24, UNDECIDED)):
        frame = unit({"proposed": 5.0, "opposite": 5.0}, 0.1, n_objects=n_objects)
        frame.loc[frame["method"] == "opposite", "error_deg"] += 8.0 * frame["fold"]
        assert verdict_of(Better("mae_sigma", a, b), {MUG: frame}) == expected


def test_pooling_categories_does_not_make_enough_objects():
    units = [(category, 0) for category in CATEGORIES]
    frames = {key: unit({"proposed": 4.0, "opposite": 10.0}, 0.1, n_objects=3) for key in units}
    a, b = (Term(method, tuple(units)) for method in ("proposed", "opposite"))
    assert verdict_of(Better("mae", a, b), frames) == UNDECIDED


def test_the_table_of_claims_is_tidy_and_repeatable(evaluations):
    once = evaluate_claims(evaluations, np.random.default_rng(1), 100)
    again = evaluate_claims(dict(reversed(evaluations.items())), np.random.default_rng(1), 100)
    pd.testing.assert_frame_equal(once, again)
    assert not once.duplicated(["id", "part"]).any()
    assert len(once.drop_duplicates(["id", "verdict"])) == len(CLAIMS)


def test_claims_come_back_and_half_a_file_is_refused(evaluations, rng, tmp_path):
    path = tmp_path / "claims.csv"
    write_csv(path, evaluate_claims(evaluations, rng, 100))
    assert list(read_claims(path)["id"].drop_duplicates()) == [claim.id for claim in CLAIMS]
    lines = path.read_text().splitlines(keepends=True)
    for kept in (lines[: len(lines) // 2], lines[:-1], lines[:1]):
        path.write_text("".join(kept))
        with pytest.raises(UserError, match=r"claims\.csv: .*; delete the file"):
            read_claims(path)
    path.write_text("".join(lines).replace(UNDECIDED, "perhaps"))
    with pytest.raises(UserError, match="'perhaps' is not a verdict"):
        read_claims(path)
