"""Every checkable sentence of the paper's Section 3.3 and Conclusion, from ``claims.csv``.

"Best" means better than each of the other three methods. Where a sentence says "comparable" and
gives no margin, ours is 1 degree of MAE or median, and 1 percentage point of pAUC.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from nbv.experiment.paper.published import FOCUS_CATEGORY, METHODS, paper_rows
from nbv.experiment.paper.statements import (
    AtLeast,
    Better,
    Claim,
    Comparable,
    FreeOfOutliers,
    Statement,
    Term,
    all_of,
)
from nbv.experiment.results import Unit
from nbv.labels import category_label

PROPOSED, OPPOSITE, RANDOM, SINGLE = "proposed", "opposite", "random", "single"
CATEGORIES = ("airplane", "car", "chair", "mug", "toilet")
ELEVATIONS_DEG = (0, 15, 30, 45, 60, 75)
MARGIN = 1.0

_MUG: Unit = (FOCUS_CATEGORY, 0)
_ALL_CATEGORIES: tuple[Unit, ...] = tuple((category, 0) for category in CATEGORIES)


def best(statistic: str, term: Term, label: str = "") -> AtLeast:
    """Return the statement that the term's method is better than each of the other methods."""
    return all_of([Better(statistic, term, other) for other in _others(term)], label)


def ranked(statistic: str, term: Term, rank: int) -> AtLeast:
    """Return the statement that exactly ``rank - 1`` of the other methods are better."""
    others = _others(term)
    behind = AtLeast(len(others) - rank + 1, tuple(Better(statistic, term, o) for o in others))
    ahead = AtLeast(rank - 1, tuple(Better(statistic, o, term) for o in others))
    return all_of([behind, ahead])


def _not_best_but_comparable(statistic: str, term: Term) -> AtLeast:
    """Return the statement that some method is better, and Opposite by less than the margin."""
    close = Comparable(statistic, term, replace(term, method=OPPOSITE), MARGIN)
    return all_of([close, AtLeast(1, tuple(Better(statistic, o, term) for o in _others(term)))])


def _others(term: Term) -> list[Term]:
    """Return the term with each of the other methods."""
    return [replace(term, method=method) for method in METHODS if method != term.method]


def _at(elevation_deg: int, method: str = PROPOSED) -> Term:
    return Term(method, ((FOCUS_CATEGORY, elevation_deg),))


def _of(category: str, method: str = PROPOSED) -> Term:
    return Term(method, ((category, 0),))


def _best_by_category(statistic: str, categories: Sequence[str]) -> tuple[Statement, ...]:
    return tuple(best(statistic, _of(name), category_label(name)) for name in categories)


def _best_by_elevation(statistic: str) -> tuple[Statement, ...]:
    return tuple(best(statistic, _at(e), f"{e}°") for e in ELEVATIONS_DEG)


def _two_views_parts(statistic: str) -> tuple[Statement, ...]:
    terms = [(_of(name, SINGLE), category_label(name)) for name in CATEGORIES if name != "mug"]
    terms += [(_at(e, SINGLE), f"Mug {e}°") for e in ELEVATIONS_DEG]
    return tuple(
        all_of([Better(statistic, other, term) for other in _others(term)], label)
        for term, label in terms
    )


_STATEMENTS: Mapping[str, Statement] = {
    "mae-categories": AtLeast(4, _best_by_category("mae", CATEGORIES)),
    "mae-chair-third": ranked("mae", _of("chair"), 3),
    "mae-elevations": AtLeast(4, _best_by_elevation("mae")),
    "mae-75-opposite": all_of(
        [
            *(Better("mae", _at(e), _at(e, OPPOSITE)) for e in ELEVATIONS_DEG[:-1]),
            Better("mae", _at(75, OPPOSITE), _at(75)),
        ]
    ),
    "mae-75-comparable": _not_best_but_comparable("mae", _at(75)),
    "hidden-range": Better("mae", Term(PROPOSED, (_MUG,), group=2), Term(SINGLE, (_MUG,), group=2)),
    "two-views": all_of(_two_views_parts("mae")),
    "two-views-pauc": all_of(_two_views_parts("pauc")),
    "better-than-recommenders": all_of(
        [
            Better("mae", Term(PROPOSED, _ALL_CATEGORIES), Term(m, _ALL_CATEGORIES))
            for m in (RANDOM, OPPOSITE)
        ]
    ),
    "pauc-categories": AtLeast(4, _best_by_category("pauc", CATEGORIES)),
    "pauc-elevations": AtLeast(5, _best_by_elevation("pauc")),
    "pauc-75-comparable": _not_best_but_comparable("pauc", _at(75)),
    "high-elevation-easy": Better("mae", _at(75, SINGLE), _at(0, SINGLE)),
    "groups": AtLeast(
        3,
        tuple(best("mae", Term(PROPOSED, (_MUG,), group=g), f"group {g}") for g in (1, 2, 3, 4)),
    ),
    "examples": best("mae", Term(PROPOSED, (_MUG,), initial_deg=(0, 30, 210, 330))),
    "median-airplane": best("median", _of("airplane")),
    "median-mug": best("median", _of("mug")),
    "median-car": Comparable("median", _of("car"), _of("car", OPPOSITE), MARGIN),
    "median-toilet": Comparable("median", _of("toilet"), _of("toilet", OPPOSITE), MARGIN),
    "median-chair": ranked("median", _of("chair"), 3),
    "outliers": all_of([FreeOfOutliers(_of(name)) for name in CATEGORIES]),
    "sigma-mae": ranked("mae_sigma", _of("mug"), 2),
    "pauc-folds": all_of(
        [best("pauc", Term(PROPOSED, (_MUG,), fold=f), f"fold {f}") for f in (2, 3, 4, 5)]
    ),
    "sigma-pauc": best("pauc_sigma", _of("mug")),
    "outperforms-all": best("mae", Term(PROPOSED, _ALL_CATEGORIES)),
    "stable": all_of(
        [
            Better("mae", _of("mug"), _of("mug", SINGLE)),
            Better("mae_sigma", _of("mug"), _of("mug", SINGLE)),
        ]
    ),
}


CLAIMS = tuple(Claim(**row, statement=_STATEMENTS[row["id"]]) for row in paper_rows("claims.csv"))
