"""The explorer: an interactive HTML page with the estimates and next views of every method.

It is self-contained: no network, no server. Errors are those of the evaluation files; the page
computes only the beliefs after several views (``explorer_beliefs.js``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

from nbv.core.circle.criteria import CRITERIA
from nbv.data.depth_images import open_depth
from nbv.errors import UserError
from nbv.experiment.estimates import read_posteriors
from nbv.experiment.explorer.data import (
    COLUMNS,
    Outcomes,
    distributions_text,
    outcomes_of,
    outcomes_text,
    page_table,
    ring_of,
)
from nbv.experiment.report.table import HTML
from nbv.experiment.results import EvaluationFile, Unit, load_evaluations
from nbv.files import existing
from nbv.labels import category_label, method_label
from nbv.style import method_style
from nbv.tables.lookup import LookupTable

LookupFile = tuple[str, int, int, str]
"""The key of a lookup table: category, elevation in degrees, fold and criterion."""

_MOST_COARSE_BINS = 120


@dataclass(frozen=True)
class ExplorerInputs:
    """The files and settings of the page of a run with this name.

    Policies are by method. Every fold has lookup tables of the same criteria. Views chosen by the
    information gain are `min_separation_deg` or more apart, and `n_views` at most. Depth images,
    with the ids of their objects, are empty for estimates of another program; `posteriors` are by
    category, elevation and fold, if the estimator gives distributions. `caution` (see
    `nbv.experiment.plan`) precedes all numbers.
    """

    name: str
    policies: Mapping[str, str]
    evaluations: Mapping[EvaluationFile, Path]
    lookups: Mapping[LookupFile, Path]
    min_separation_deg: float
    n_views: int
    depth: Mapping[Unit, Path] = field(default_factory=dict)
    objects: Mapping[Unit, Path] = field(default_factory=dict)
    posteriors: Mapping[tuple[str, int, int], Path] = field(default_factory=dict)
    caution: Sequence[str] = ()


def build_explorer(inputs: ExplorerInputs) -> str:
    """Return the page of a finished run.

    Raise UserError if a file is missing or damaged, the objects of files differ, or no method
    follows a lookup table.
    """
    if not inputs.lookups:
        raise UserError("the explorer shows lookup tables, and no method of this run follows one")
    frames = load_evaluations(inputs.evaluations)
    named = (str(name) for frame in frames.values() for name in frame["method"].unique())
    methods = tuple(dict.fromkeys(named))
    criteria = list(dict.fromkeys(criterion for *_, criterion in inputs.lookups))
    chunks: dict[str, str] = {}
    units: list[dict[str, Any]] = []
    for index, (unit, frame) in enumerate(frames.items()):
        outcomes = outcomes_of(unit, frame)
        chunks[f"unit-{index}"] = outcomes_text(outcomes)
        tables = _add_tables(chunks, inputs, criteria, index, unit, outcomes)
        images = _add_images(chunks, inputs, index, unit, outcomes)
        distributions = _add_distributions(chunks, inputs, index, unit, outcomes)
        units.append(
            {
                "category": unit[0],
                "label": category_label(unit[0]),
                "elevation": unit[1],
                "tables": tables,
                "images": images,
                "own": distributions,
                "objects": outcomes.object_ids,
                "folds": outcomes.folds,
                "views": outcomes.n_views,
                "turns": list(outcomes.rotation),
                "means": outcomes.means,
                "overall": outcomes.overall,
            }
        )
    facts = {
        "run": inputs.name,
        "methods": [
            {
                "name": name,
                "label": method_label(name),
                "color": method_style(name, methods).color,
                "criterion": policy if (policy := inputs.policies[name]) in CRITERIA else None,
            }
            for name in methods
        ],
        "criteria": criteria,
        "apart": inputs.min_separation_deg,
        "mostViews": inputs.n_views,
        "units": units,
    }
    return HTML.get_template("explorer.html.j2").render(
        name=inputs.name,
        caution=inputs.caution,
        facts=facts,
        units=units,
        methods=facts["methods"],
        criteria=[name.replace("_", " ") for name in criteria],
        n_first_views=sum(len(unit["objects"]) * unit["views"] for unit in units),
        most_views=inputs.n_views,
        chunks=chunks,
    )


def _add_tables(
    chunks: dict[str, str],
    inputs: ExplorerInputs,
    criteria: list[str],
    index: int,
    unit: Unit,
    outcomes: Outcomes,
) -> list[dict[str, Any]]:
    facts = []
    for i, (fold, criterion) in enumerate(product(sorted(set(outcomes.folds)), criteria)):
        table = LookupTable.load(existing(inputs.lookups[*unit, fold, criterion]))
        stored = page_table(table)
        chunks[f"table-{index}-{i}"] = stored.text
        coarse = coarse_bins(len(table.cost), outcomes.n_views)
        facts.append({"fold": fold, "criterion": criterion, "coarse": coarse, **stored.facts})
    return facts


def coarse_bins(n_bins: int, n_views: int) -> int:
    """Return the number of bins that the page uses to choose further views.

    At most 120, as in `nbv.core.circle.evidence`; a rotation by a bin leads from view to view,
    and each bin is an odd number of the table's, so that the centres agree.
    """
    return max(
        n
        for n in range(1, _MOST_COARSE_BINS + 1)
        if n_bins % n == 0 and n_views % n == 0 and n_bins // n % 2 == 1
    )


def _add_images(
    chunks: dict[str, str], inputs: ExplorerInputs, index: int, unit: Unit, outcomes: Outcomes
) -> dict[str, int] | None:
    if not inputs.depth:
        return None
    images = open_depth(existing(inputs.depth[unit]), existing(inputs.objects[unit]))
    for i, object_id in enumerate(outcomes.object_ids):
        ring = ring_of(images.of([object_id])[0])
        chunks[f"ring-{index}-{i}"] = ring.data
    return {"count": ring.n_images, "side": ring.side, "columns": COLUMNS}


def _add_distributions(
    chunks: dict[str, str], inputs: ExplorerInputs, index: int, unit: Unit, outcomes: Outcomes
) -> dict[str, int] | None:
    if not inputs.posteriors:
        return None
    for fold in sorted(set(outcomes.folds)):
        tested = zip(outcomes.object_ids, outcomes.folds, strict=True)
        ids = [name for name, tested_in in tested if tested_in == fold]
        posteriors = read_posteriors(existing(inputs.posteriors[*unit, fold]), ids)
        chunks[f"own-{index}-{fold}"] = distributions_text(posteriors)
    return {"classes": posteriors.log_posterior.shape[2]}
