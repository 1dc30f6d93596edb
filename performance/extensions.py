"""What goes beyond the paper: all tables of one unit, and one more look, against bounds in time."""

from __future__ import annotations

import numpy as np

from nbv.experiments.more_views import COARSE_BINS, Walk, recommended_step
from nbv.recommendation.belief import BELIEF_CRITERIA, first_beliefs, updated
from nbv.recommendation.criteria import CRITERIA
from nbv.recommendation.evidence import Evidence, gather_evidence
from nbv.recommendation.fusion import FUSIONS
from nbv.recommendation.lookup import build_lookup
from performance.figures import Figure, Target
from performance.lookup import calibration_estimates
from performance.settings import configuration
from performance.timing import on_one_core, take_turns

TABLES_SECONDS = Target(3.0, at_most=True)
STEP_MILLISECONDS = Target(20.0, at_most=True)


def _evidence(n_bins: int) -> Evidence:
    return gather_evidence(
        calibration_estimates(20, 360),
        configuration()["density"],
        bandwidth_deg=8.0,
        pseudo_observations=30.0,
        n_bins=n_bins,
    )


def run(quick: bool) -> list[Figure]:
    with on_one_core():
        return [_tables(quick), *_steps(quick)]


def _tables(quick: bool) -> Figure:
    n_bins, rounds = (72, 1) if quick else (360, 5)

    def every_table() -> None:
        for criterion in CRITERIA:
            for fusion in FUSIONS:
                # Each has a density of its own, so that nothing can be shared.
                build_lookup(_evidence(n_bins), criterion, fusion)

    def papers_table() -> None:
        build_lookup(_evidence(n_bins), "entropy")

    turns = take_turns([every_table, papers_table], rounds)
    detail = (
        f"{len(CRITERIA)} criteria with {len(FUSIONS)} fusion rules, {n_bins} bins, one core; "
        f"{turns.ratio(0, 1):.1f} times the paper's table alone ({turns.typical(1):.2f} s)"
    )
    return Figure("all tables of one unit, seconds", turns.typical(0), TABLES_SECONDS, detail)


def _steps(quick: bool) -> list[Figure]:
    fine, coarse = _evidence(360), _evidence(COARSE_BINS)
    beliefs = first_beliefs(np.array([90.0]), fine)
    taken = np.zeros((1, 1), dtype=np.int64)
    rng = np.random.default_rng(0)
    figures = []
    for criterion in BELIEF_CRITERIA:
        step = recommended_step(criterion, coarse, 15.0)

        def look_again(step=step) -> None:  # type: ignore[no-untyped-def]
            delta = step(Walk(beliefs, taken), rng)
            updated(beliefs, np.array([200.0]), delta, fine)

        milliseconds = 1e3 * take_turns([look_again], 3 if quick else 50).typical(0)
        name = f"one more look ({criterion}), milliseconds"
        figures.append(Figure(name, milliseconds, STEP_MILLISECONDS, "one core, one belief"))
    return figures
