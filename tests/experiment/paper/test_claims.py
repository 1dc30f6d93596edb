from dataclasses import replace

import numpy as np
import pytest

from claim_frames import everywhere, unit
from nbv.experiment.paper import statements
from nbv.experiment.paper.claims import CLAIMS
from nbv.experiment.paper.statements import (
    FAILS,
    HOLDS,
    NOT_RUN,
    UNDECIDED,
    AtLeast,
    Better,
    FreeOfOutliers,
    Term,
)
from nbv.experiment.paper.verdicts import evaluate_claims


def test_ids_are_unique_and_quotes_name_their_section():
    ids = [claim.id for claim in CLAIMS]
    assert len(ids) == len(set(ids))
    assert {claim.section for claim in CLAIMS} == {"3.3.1", "3.3.2", "3.3.3", "3.3.4", "4"}
    for claim in CLAIMS:
        leaves = statements.leaves(claim.statement)
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


def test_a_compound_shows_the_competitor_that_decides():
    """Not the one that is closest, if it is decided and the part is not."""
    proposed = Term("proposed", (("mug", 0),))
    rivals = {name: replace(proposed, method=name) for name in ("random", "opposite")}
    near, unsure = (Better("mae", proposed, rival) for rival in rivals.values())
    shared = {"value": 5.0, "versus_value": 5.5}
    measured = {
        near: shared | {"part_verdict": HOLDS, "difference": -0.2, "ci_low": -0.3, "ci_high": -0.1},
        unsure: shared
        | {"part_verdict": UNDECIDED, "difference": -0.5, "ci_low": -1.2, "ci_high": 0.2},
    }
    whole = AtLeast(1, (statements.all_of([near, unsure], "Mug"),))
    text = statements.summarise(whole, measured)
    assert text.startswith("Mug: undecided (")
    assert "Opposite" in text
    assert "Random" not in text


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
    contradicted = {name for name in verdicts.index if verdicts[name] == "contradict it"}
    assert contradicted == {"two-views-pauc"}  # Table 3: Car has 92.35 of Single, 91.52 of Opposite
    assert set(verdicts.drop([*unprinted, *contradicted])) == {"bear it out"}
