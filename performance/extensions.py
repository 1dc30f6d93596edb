"""Extensions: all tables of one unit against the paper's, and one more view, bounded in time."""

from __future__ import annotations

import numpy as np

from nbv.core.belief import first_belief, updated
from nbv.core.criteria import CRITERIA, FOR_MORE_VIEWS
from nbv.core.evidence import COARSE_BINS, Evidence, gather_evidence
from nbv.core.fusion import ESTIMATE_FUSIONS
from nbv.core.lookup import build_lookup
from nbv.core.simulation import recommended_next
from performance.figures import Figure, Target
from performance.lookup import calibration_estimates
from performance.settings import configuration
from performance.timing import on_one_core, take_turns

TABLES = Target(15.0, at_most=True)
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

    # The Bayes expectation is there to choose more views by; no extension tabulates it.
    criteria = [criterion for criterion in CRITERIA if criterion != "bayes_error"]

    def every_table() -> None:
        for criterion in criteria:
            for fusion in ESTIMATE_FUSIONS:
                # Each has a density of its own, so that nothing can be shared.
                build_lookup(_evidence(n_bins), criterion, fusion)

    def papers_table() -> None:
        build_lookup(_evidence(n_bins), "pose_ambiguity")

    turns = take_turns([every_table, papers_table], rounds)
    detail = (
        f"{len(criteria)} criteria with {len(ESTIMATE_FUSIONS)} fusion rules, {n_bins} bins, one "
        f"core: {turns.typical(0):.2f} s against {turns.typical(1):.2f} s"
    )
    return Figure("all tables of one unit / the paper's table", turns.ratio(0, 1), TABLES, detail)


def _steps(quick: bool) -> list[Figure]:
    fine, coarse = _evidence(360), _evidence(COARSE_BINS)
    first = first_belief(np.array([90.0]), fine)
    taken = np.zeros((1, 1), dtype=np.int64)
    rng = np.random.default_rng(0)
    figures = []
    for criterion in ("pose_ambiguity", *FOR_MORE_VIEWS):
        next_view = recommended_next(criterion, coarse, 15.0)

        def one_more_view(next_view=next_view) -> None:  # type: ignore[no-untyped-def]
            delta = next_view(first, taken, rng)
            updated(first, np.array([200.0]), delta, fine)

        milliseconds = 1e3 * take_turns([one_more_view], 3 if quick else 50).typical(0)
        name = f"one more view ({criterion}), milliseconds"
        figures.append(Figure(name, milliseconds, STEP_MILLISECONDS, "one core, one belief"))
    return figures
