"""How well densities know the azimuth: V of the estimate, and a classifier's own p(azimuth | I).

Columns of the tidy table are `cells.CELL_COLUMNS`: ``method`` is ``<run>:<density>`` with a density
of `DENSITIES`, ``metric`` one of `METRICS`, and ``difference*`` compares with V of the first run.
"""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.angles import nearest_bin
from nbv.core.criteria import circular_variance, entropy
from nbv.core.estimates import Estimates
from nbv.core.logits import log_likelihood, on_degrees
from nbv.core.lookup import load_lookup
from nbv.experiment.estimates import read_estimates, read_posteriors
from nbv.experiment.report.settings import (
    CELL_COLUMNS,
    ReportSettings,
    common_elevation_deg,
    method_cells,
    shared_resampler,
    unit_label,
)
from nbv.experiment.report.table import DECIDED, Cell, Row, Table, difference_cell
from nbv.experiment.results import Unit
from nbv.experiment.statistics.object_means import FoldFile
from nbv.experiment.statistics.paired import pair_methods
from nbv.files import existing
from nbv.labels import interval_text, number

DENSITIES: Mapping[str, str] = {
    "estimate": "V of the estimate",
    "as_trained": "p(φ given I), as trained",
    "posterior": "p(φ given I), at its temperature",
}
_OF_DENSITIES = ("log_likelihood", "entropy", "circular_variance")
_OF_ERRORS = ("single", "opposite", "recommended")
METRICS = (*_OF_DENSITIES, *_OF_ERRORS)
METHODS: Mapping[str, Mapping[str, str]] = {
    "estimate": dict(zip(_OF_ERRORS, ("single", "opposite", "proposed"), strict=True)),
    "posterior": dict(zip(_OF_ERRORS, ("single", "opposite_product", "gain_product"), strict=True)),
}
"""Whose errors a density's are, by the metric."""

_NAME = "density_comparison"
_KEY = ["fold", "object_id", "initial_deg"]


@dataclass(frozen=True)
class DensityRun:
    """What a run says about its densities.

    Attributes
    ----------
    evaluations : mapping of (category, elevation_deg) to DataFrame
        Of `nbv.experiment.results.load_evaluations`, with the methods of `METHODS`; those of
        ``posterior`` only where there are posteriors.
    estimates, lookups : mapping of (category, elevation_deg, fold) to Path
        Test estimates, and the lookup tables whose V is compared.
    posteriors : mapping of (category, elevation_deg, fold) to Path
        Test posteriors; empty where the estimator gives no distributions.
    """

    evaluations: Mapping[Unit, pd.DataFrame]
    estimates: Mapping[FoldFile, Path]
    lookups: Mapping[FoldFile, Path]
    posteriors: Mapping[FoldFile, Path] = field(default_factory=dict)


def density_comparison(runs: Mapping[str, DensityRun], settings: ReportSettings) -> Table:
    """Return the mean of every metric for every density of every run, with its uncertainty.

    The first run is what the others are compared with, on its units.

    Returns
    -------
    Table
        ``log_likelihood`` in nats per degree, at the true azimuth; ``entropy`` in nats, over
        one-degree bins; ``circular_variance`` in [0, 1]; ``single``, ``opposite`` and
        ``recommended`` the error (degrees) of one view, with the opposite second one, and with the
        second one that the density recommends. Two estimates are averaged; a classifier's two
        distributions are multiplied.

    Raises
    ------
    UserError
        Where a file is missing, or runs were tested on different images.
    """
    first = next(iter(runs))
    units = list(runs[first].evaluations)
    elevation = common_elevation_deg(units, settings)
    resampler = shared_resampler(settings)
    cells = []
    for unit in units:
        frames: dict[str, list[pd.DataFrame]] = {metric: [] for metric in METRICS}
        for name, run in runs.items():
            for density, metric, frame in _metrics(run, unit):
                frames[metric].append(frame.assign(method=f"{name}:{density}"))
        for metric, parts in frames.items():
            sample = pair_methods(pd.concat(parts), unit[0])
            shown = replace(
                settings, methods=tuple(sample.errors_deg), reference=f"{first}:estimate"
            )
            label = unit_label(unit, elevation)
            made = method_cells(_NAME, unit[0], label, "mae", sample, resampler, shown)
            cells += [cell | {"metric": metric} for cell in made]
    frame = pd.DataFrame(cells, columns=list(CELL_COLUMNS))
    header = (
        "Category",
        "Run",
        "Density",
        "Log-likelihood (nats per degree)",
        f"… less that of V, {first}",
        "Entropy (nats)",
        "Circular variance",
        "Single",
        "Opposite",
        "Recommended",
    )
    notes = (*_NOTES, DECIDED, *_temperature_notes(runs, units))
    title = "How well densities know the azimuth"
    return Table(_NAME, title, title, frame, header, _rows(frame), notes, n_text_columns=3)


def _of_unit(files: Mapping[FoldFile, Path], unit: Unit) -> Iterator[tuple[int, Path]]:
    """Yield the fold and the file of each of a unit's folds."""
    for (category, elevation_deg, fold), path in files.items():
        if (category, elevation_deg) == unit:
            yield fold, existing(path)


def _metrics(run: DensityRun, unit: Unit) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Yield (density, metric, frame): ``fold, object_id, initial_deg, error_deg`` = the metric."""
    for fold, path in _of_unit(run.estimates, unit):
        for density, found in _of_images(run, (*unit, fold), read_estimates(path)):
            for metric in _OF_DENSITIES:
                yield density, metric, found[_KEY].assign(error_deg=found[metric])
    errors = run.evaluations[unit]
    for density in METHODS if run.posteriors else ["estimate"]:
        for metric, method in METHODS[density].items():
            yield density, metric, errors.loc[errors["method"] == method, [*_KEY, "error_deg"]]


def _of_images(
    run: DensityRun, place: FoldFile, test: Estimates
) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield each density's log-likelihood and spread for every test image of a fold."""
    n_objects, n_views = test.estimate_deg.shape
    images = pd.DataFrame(
        {
            "fold": place[-1],
            "object_id": np.repeat(np.asarray(test.object_ids, dtype=object), n_views),
            "initial_deg": np.tile(test.azimuth_deg, n_objects),
        }
    )
    V = load_lookup(existing(run.lookups[place])).viewpoint_likelihood
    rows = nearest_bin(test.estimate_deg.ravel(), len(V))
    truth = nearest_bin(images["initial_deg"].to_numpy(), len(V))
    per_degree = np.log(len(V) / 360.0)
    yield (
        "estimate",
        images.assign(
            log_likelihood=np.log(V[rows, truth].astype(np.float64)) + per_degree,
            entropy=entropy(V)[rows],
            circular_variance=circular_variance(V)[rows],
        ),
    )
    if run.posteriors:
        read = read_posteriors(existing(run.posteriors[place]), test.object_ids)
        logs: Mapping[str, NDArray[np.float64]] = {
            "as_trained": read.as_trained,
            "posterior": read.log_posterior.astype(np.float64),
        }
        for density, log_posterior in logs.items():
            spread = on_degrees(np.exp(log_posterior)).reshape(-1, 360).astype(np.float32)
            yield (
                density,
                images.assign(
                    log_likelihood=log_likelihood(log_posterior, test.azimuth_deg).ravel(),
                    entropy=entropy(spread),
                    circular_variance=circular_variance(spread),
                ),
            )


_NOTES = (
    "Means over test images, with 95 % intervals over objects. Log-likelihood is the log "
    "density at the true azimuth, higher is better; the uniform density has −5.89. Entropy and "
    "circular variance say how wide a density is.",
    "V is the smoothed density of calibration pairs that the paper's lookup table is made of, "
    "chosen for its decisions and not for its likelihood.",
    "Single, Opposite and Recommended are errors (°) of one view, and of two: the second "
    "opposite, and the second that the density recommends. With V two estimates are averaged, "
    "and what is recommended is the paper's; with p(φ given I) both images' densities are "
    "multiplied, and the least expected entropy is recommended.",
)


def _temperature_notes(runs: Mapping[str, DensityRun], units: Iterable[Unit]) -> Iterator[str]:
    """Yield a line on each unit's temperatures, fold by fold, for runs that have posteriors."""
    for (name, run), unit in itertools.product(runs.items(), units):
        found = []
        for fold, path in _of_unit(run.posteriors, unit):
            objects = read_estimates(existing(run.estimates[*unit, fold])).object_ids
            found.append(number(read_posteriors(path, objects).temperature))
        if found:
            yield f"Temperatures of {name}, {unit[0]}, by fold: {', '.join(found)}."


def _rows(cells: pd.DataFrame) -> tuple[Row, ...]:
    rows = []
    for (category, method), part in cells.groupby(["row_label", "method"], sort=False):
        run, _, density = str(method).rpartition(":")
        found = {cell["metric"]: cell for cell in part.to_dict("records")}
        texts = [str(category), run, DENSITIES[density]]
        first, *others = (Cell(_with_interval(found.get(metric), metric)) for metric in METRICS)
        rows.append((*map(Cell, texts), first, _gain(found[METRICS[0]]), *others))
    return tuple(rows)


def _gain(cell: Mapping[Hashable, Any]) -> Cell:
    if not np.isfinite(cell["difference"]):
        return Cell("–")
    return difference_cell(cell["difference"], cell["difference_low"], cell["difference_high"])


def _with_interval(cell: Mapping[Hashable, Any] | None, metric: str) -> str:
    if cell is None or not np.isfinite(cell["value"]):
        return "–"
    decimals = 3 if metric == "circular_variance" else 2
    return interval_text(cell["value"], cell["ci_low"], cell["ci_high"], decimals)
