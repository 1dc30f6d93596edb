from __future__ import annotations

from itertools import product

import numpy as np
import pandas as pd
import pytest

from nbv.paper import statements as comparisons
from nbv.paper.claims import CATEGORIES, CLAIMS, ELEVATIONS_DEG, best, ranked
from nbv.paper.statements import (
    FAILS,
    HOLDS,
    NOT_RUN,
    UNDECIDED,
    AtLeast,
    Better,
    Claim,
    Comparable,
    FreeOfOutliers,
    Term,
    combine,
)
from nbv.paper.verdicts import evaluate_claims
from nbv.reporting.paper.claims import claims_markdown
from nbv.reporting.paper.tables import build_table
from nbv.reporting.settings import ReportSettings

N_OBJECTS = 40
MUG = ("mug", 0)


def unit(means, noise=1.0, seed=0, n_objects=N_OBJECTS, n_views=36):
    """A frame in which each method's error is a mean, an object's own share and some noise."""
    rng = np.random.default_rng(seed)
    parts = []
    for method, mean in means.items():
        errors = (
            mean + rng.normal(0, noise, (n_objects, 1)) + rng.normal(0, 0.3, (n_objects, n_views))
        )
        parts.append(
            pd.DataFrame(
                {
                    "method": method,
                    "fold": np.repeat(np.arange(n_objects) % 5 + 1, n_views),
                    "object_id": np.repeat([f"{i:03d}" for i in range(n_objects)], n_views),
                    "initial_deg": np.tile(np.arange(n_views) * 10, n_objects),
                    "error_deg": np.clip(errors, 0, 180).ravel(),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def everywhere(means, **options):
    units = [(category, 0) for category in CATEGORIES]
    units += [("mug", elevation) for elevation in ELEVATIONS_DEG[1:]]
    return {key: unit(means, seed=index, **options) for index, key in enumerate(units)}


def verdict_of(statement, evaluations, seed=0):
    claim = Claim("one", "3.3", "a sentence", "a rule", statement)
    found = evaluate_claims(evaluations, np.random.default_rng(seed), 500, [claim])
    return found["verdict"].iloc[0]


def term(method, **rest):
    return Term(method, (MUG,), **rest)


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


def test_identical_methods_are_undecided_and_differ_by_nothing():
    frame = unit({"single": 9.0})
    both = {MUG: pd.concat([frame, frame.assign(method="proposed")], ignore_index=True)}
    claim = Claim("same", "3", "s", "c", Better("mae", term("proposed"), term("single")))
    found = evaluate_claims(both, np.random.default_rng(0), 200, [claim]).iloc[0]
    assert found["verdict"] == UNDECIDED
    assert (found["difference"], found["ci_low"], found["ci_high"]) == (0.0, 0.0, 0.0)


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


@pytest.mark.parametrize(
    ("count", "verdicts", "expected"),
    [
        (2, [HOLDS, HOLDS, FAILS], HOLDS),
        (2, [HOLDS, FAILS, FAILS], FAILS),
        (2, [HOLDS, UNDECIDED, FAILS], UNDECIDED),
        (2, [HOLDS, HOLDS, NOT_RUN], HOLDS),
        (2, [NOT_RUN, FAILS, FAILS], FAILS),
        (2, [HOLDS, NOT_RUN, FAILS], NOT_RUN),
        (3, [NOT_RUN, UNDECIDED, HOLDS], NOT_RUN),
    ],
)
def test_compounds_are_decided_only_where_open_parts_cannot_matter(count, verdicts, expected):
    assert combine(count, verdicts) == expected


def test_combining_agrees_with_trying_out_every_open_part():
    for verdicts in product([HOLDS, FAILS, UNDECIDED], repeat=4):
        for count in range(1, 5):
            options = [(True, False) if v == UNDECIDED else ((v == HOLDS),) for v in verdicts]
            outcomes = {sum(choice) >= count for choice in product(*options)}
            expected = {frozenset({True}): HOLDS, frozenset({False}): FAILS}.get(
                frozenset(outcomes), UNDECIDED
            )
            assert combine(count, list(verdicts)) == expected


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


def test_a_method_that_wins_everywhere_bears_out_what_it_should():
    found = evaluate_claims(
        everywhere({"single": 12.0, "random": 10.0, "opposite": 9.8, "proposed": 8.0}, noise=0.3),
        np.random.default_rng(0),
        500,
    )
    verdicts = found.drop_duplicates("id").set_index("id")["verdict"]
    for name in (
        "mae-categories",
        "mae-elevations",
        "pauc-categories",
        "pauc-elevations",
        "groups",
        "two-views",
        "better-than-recommenders",
        "hidden-range",
        "outperforms-all",
        "median-mug",
        "median-airplane",
        "pauc-folds",
    ):
        assert verdicts[name] == HOLDS, name
    not_the_best = ("mae-75-comparable", "pauc-75-comparable")
    for name in ("mae-chair-third", "mae-75-opposite", "median-chair", *not_the_best):
        assert verdicts[name] == FAILS, name
    assert NOT_RUN not in set(verdicts)


@pytest.mark.parametrize(
    ("proposed", "expected"),
    [
        (10.6, HOLDS),  # behind Opposite, and close to it
        (9.4, FAILS),  # close to Opposite, and the best
        (14.0, FAILS),  # behind Opposite, and far from it
    ],
)
def test_not_the_best_but_comparable_is_both(proposed, expected):
    means = {"single": 16.0, "random": 15.0, "opposite": 10.0, "proposed": proposed}
    frames = {("mug", 75): unit(means, noise=0.3)}
    claims = [claim for claim in CLAIMS if claim.id.endswith("75-comparable")]
    found = evaluate_claims(frames, np.random.default_rng(0), 500, claims)
    each = found.drop_duplicates("id")
    assert list(each["id"]) == ["mae-75-comparable", "pauc-75-comparable"]
    assert list(each["verdict"]) == list(each["point_verdict"]) == [expected] * 2
    for summary in each["summary"]:
        assert all(f"{name} " in summary for name in ("Single", "Random", "Opposite", "Proposed"))


def test_what_was_not_run_is_reported_as_such(evaluations, rng):
    found = evaluate_claims(evaluations, rng, 200).drop_duplicates("id").set_index("id")["verdict"]
    for name in ("mae-75-comparable", "median-airplane", "outperforms-all", "mae-elevations"):
        assert found[name] == NOT_RUN
    assert found["hidden-range"] == HOLDS
    nothing = evaluate_claims({}, rng, 10)
    assert set(nothing["verdict"]) == {NOT_RUN}


def test_a_method_that_was_not_run_is_not_run():
    frame = unit({"single": 10.0, "proposed": 8.0})
    assert verdict_of(best("mae", term("proposed")), {MUG: frame}) == NOT_RUN


def test_the_papers_own_figures_bear_out_its_sentences():
    found = evaluate_claims({}, np.random.default_rng(0), 10).drop_duplicates("id")
    verdicts = found.set_index("id")["published_verdict"]
    unprinted = {name for name in verdicts.index if verdicts[name] == "not printed"}
    assert unprinted == {
        "examples",
        "median-airplane",
        "median-mug",
        "median-car",
        "median-toilet",
        "median-chair",
        "outliers",
    }
    assert set(verdicts[~verdicts.index.isin(unprinted)]) == {"bear it out"}


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


def test_ids_are_unique_and_quotes_name_their_section():
    ids = [claim.id for claim in CLAIMS]
    assert len(ids) == len(set(ids))
    assert {claim.section for claim in CLAIMS} == {"3.3.1", "3.3.2", "3.3.3", "3.3.4", "4"}
    for claim in CLAIMS:
        leaves = comparisons.leaves(claim.statement)
        assert leaves, claim.id
        for leaf in leaves:
            assert isinstance(leaf, FreeOfOutliers) or leaf.a != leaf.b, claim.id


def test_compounds_ask_for_no_more_parts_than_they_have():
    def compounds(statement):
        if isinstance(statement, AtLeast):
            yield statement
            for part in statement.parts:
                yield from compounds(part)

    for claim in CLAIMS:
        for compound in compounds(claim.statement):
            assert 0 < compound.count <= len(compound.parts), claim.id


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


def test_markdown_has_one_row_for_each_claim(evaluations, rng):
    text = claims_markdown(evaluate_claims(evaluations, rng, 100))
    run, absent = text.split("### Not run")
    rows = [[line for line in part.splitlines() if line.startswith("|")] for part in (run, absent)]
    assert len(rows[0]) + len(rows[1]) == 4 + len(CLAIMS)
    assert not any("**not run**" in row for row in rows[0][2:])
    assert all("**not run**" in row for row in rows[1][2:])
    assert len({row.count("|") for row in rows[0] + rows[1]}) == 1
    assert "nan" not in text
