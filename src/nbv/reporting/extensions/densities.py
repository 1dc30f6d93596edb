"""How well densities know the azimuth: V of the estimate, and a classifier's own p(azimuth | I).

Columns of the tidy table are `cells.CELL_COLUMNS`: ``method`` is ``<run>:<density>`` with a density
of `DENSITIES`, ``metric`` one of `METRICS`, and ``difference*`` compares with V of the first run.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.angles import nearest_bin
from nbv.calibration.estimates import read_estimates
from nbv.calibration.posteriors import log_likelihood, on_degrees, read_posteriors
from nbv.experiments.results import Unit, load_unit, lookup_path, unit_dir
from nbv.files import existing
from nbv.labels import number
from nbv.recommendation.criteria.spreads import circular_variance, entropy
from nbv.recommendation.lookup import load_lookup
from nbv.reporting.markdown import pipe_row
from nbv.reporting.paper.cells import CELL_COLUMNS, method_cells, shared_resampler
from nbv.reporting.settings import ReportSettings as ReadingSettings
from nbv.reporting.settings import common_elevation_deg, unit_label
from nbv.statistics.paired import pair_methods

DENSITIES: Mapping[str, str] = {
    "estimate": "V of the estimate",
    "as_trained": "p(φ given I), as trained",
    "posterior": "p(φ given I), at its temperature",
}
METRICS = (
    "log_likelihood",
    "entropy",
    "circular_variance",
    "single",
    "opposite",
    "recommended",
)

_ERRORS: Mapping[str, Mapping[str, str]] = {
    "estimate": {"single": "single", "opposite": "opposite", "recommended": "proposed"},
    "posterior": {"single": "single", "opposite": "belief_opposite", "recommended": "belief"},
}

Runs = Mapping[str, tuple[Path, bool]]
"""A run's folder, and whether its estimator has posteriors, by the run's name."""

_KEY = ["fold", "object_id", "initial_deg"]


def likelihood_cells(
    runs: Runs, units: Iterable[Unit], n_folds: int, settings: ReadingSettings
) -> pd.DataFrame:
    """Return the mean of every metric for every density of every run, with its uncertainty.

    Parameters
    ----------
    runs : mapping
        The first is what the others are compared with. All were tested on the same images.
    units : iterable of (category, elevation_deg)
        One to a row.
    n_folds : int
    settings : ReadingSettings
        ``n_resamples`` and ``seed``.

    Returns
    -------
    pandas.DataFrame
        ``log_likelihood`` in nats per degree, at the true azimuth; ``entropy`` in nats, over
        one-degree bins; ``circular_variance`` in [0, 1]; ``single``, ``opposite`` and
        ``recommended`` the error (degrees) of one view, with the opposite second one, and with the
        second one that the density recommends. Two estimates are averaged; a classifier's two
        distributions are multiplied (`nbv.experiments.image_distributions`).

    Raises
    ------
    UserError
        Where a file is missing, or runs were tested on different images.
    """
    units = list(units)
    elevation = common_elevation_deg(units, settings)
    resampler = shared_resampler(settings)
    cells = []
    for unit in units:
        frames: dict[str, list[pd.DataFrame]] = {metric: [] for metric in METRICS}
        for run, (root, has_posteriors) in runs.items():
            for density, metric, frame in _figures(root, unit, n_folds, has_posteriors):
                frames[metric].append(frame.assign(method=f"{run}:{density}"))
        for metric, parts in frames.items():
            sample = pair_methods(pd.concat(parts), unit[0])
            shown = replace(
                settings, methods=tuple(sample.errors_deg), reference=f"{next(iter(runs))}:estimate"
            )
            label = unit_label(unit, elevation)
            made = method_cells(
                "likelihoods", unit[0], label, "mae", sample, resampler, shown, comparable=False
            )
            cells += [cell | {"metric": metric} for cell in made]
    return pd.DataFrame(cells, columns=list(CELL_COLUMNS))


def temperature_notes(runs: Runs, units: Iterable[Unit], n_folds: int) -> list[str]:
    """Return a line on each unit's temperatures, fold by fold, for runs that have posteriors."""
    notes = []
    for run, (root, has_posteriors) in runs.items():
        for unit in units if has_posteriors else ():
            found = [_posteriors(root, unit, fold)[1] for fold in range(1, n_folds + 1)]
            texts = ", ".join(number(one) for one in found)
            notes.append(f"Temperatures of {run}, {unit[0]}, by fold: {texts}.")
    return notes


def _posteriors(root: Path, unit: Unit, fold: int) -> tuple[dict[str, NDArray[np.float64]], float]:
    folder = unit_dir(root, "estimates", *unit) / f"fold{fold}"
    test = read_estimates(existing(folder / "test.csv"))
    read = read_posteriors(existing(folder / "test_posteriors.npz"), test.object_ids)
    densities = {"as_trained": read.as_trained, "posterior": read.log_posterior.astype(np.float64)}
    return densities, read.temperature


def _figures(
    root: Path, unit: Unit, n_folds: int, has_posteriors: bool
) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Yield (density, metric, frame): ``fold, object_id, initial_deg, error_deg`` = the figure."""
    for fold in range(1, n_folds + 1):
        for density, figures in _density_figures(root, unit, fold, has_posteriors):
            for metric in METRICS[:3]:
                yield density, metric, figures[_KEY].assign(error_deg=figures[metric])
    for density, methods in _ERRORS.items():
        if density == "posterior" and not has_posteriors:
            continue
        errors = load_unit(root, *unit, n_folds, list(methods.values()))
        for metric, method in methods.items():
            of_method = errors[errors["method"] == method]
            yield density, metric, of_method[[*_KEY, "error_deg"]]


def _density_figures(
    root: Path, unit: Unit, fold: int, has_posteriors: bool
) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield each density's log-likelihood and spread for every test image of a fold."""
    test = read_estimates(existing(unit_dir(root, "estimates", *unit) / f"fold{fold}" / "test.csv"))
    n_objects, n_views = test.estimate_deg.shape
    images = pd.DataFrame(
        {
            "fold": fold,
            "object_id": np.repeat(np.asarray(test.object_ids, dtype=object), n_views),
            "initial_deg": np.tile(test.azimuth_deg, n_objects),
        }
    )
    V = load_lookup(existing(lookup_path(root, *unit, fold, "entropy"))).viewpoint_likelihood
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
    if has_posteriors:
        for density, log_posterior in _posteriors(root, unit, fold)[0].items():
            spread = on_degrees(np.exp(log_posterior)).reshape(-1, 360).astype(np.float32)
            yield (
                density,
                images.assign(
                    log_likelihood=log_likelihood(log_posterior, test.azimuth_deg).ravel(),
                    entropy=entropy(spread),
                    circular_variance=circular_variance(spread),
                ),
            )


def likelihoods_markdown(cells: pd.DataFrame, notes: Iterable[str] = ()) -> str:
    """Return the table of `likelihood_cells` for people, with what to bear in mind as notes."""
    reference = str(cells["method"].iloc[0])
    header = (
        "Category",
        "Run",
        "Density",
        "Log-likelihood (nats per degree)",
        f"… less that of V, {reference.rpartition(':')[0]}",
        "Entropy (nats)",
        "Circular variance",
        "Single",
        "Opposite",
        "Recommended",
    )
    lines = ["## How well densities know the azimuth", "", pipe_row(header)]
    lines.append(pipe_row(["---"] * 3 + ["---:"] * (len(header) - 3)))
    for (category, method), part in cells.groupby(["row_label", "method"], sort=False):
        run, _, density = str(method).rpartition(":")
        found = {cell["metric"]: cell for cell in part.to_dict("records")}
        texts = [_with_interval(found.get(metric), metric, "value", "ci") for metric in METRICS]
        gain = _with_interval(found[METRICS[0]], METRICS[0], "difference", "difference")
        texts.insert(1, gain)
        lines.append(pipe_row([str(category), run, DENSITIES[density], *texts]))
    explained = [
        "Means over test images, with 95 % intervals over objects. Log-likelihood is the log "
        "density at the true azimuth, higher is better; the uniform density has −5.89. Entropy and "
        "circular variance say how wide a density is.",
        "V is the smoothed density of calibration pairs that the paper's method looks up, chosen "
        "for its decisions and not for its likelihood.",
        "Single, Opposite and Recommended are errors (°) of one view, and of two: the second "
        "opposite, and the second that the density recommends. With V two estimates are averaged, "
        "and what is recommended is the paper's; with p(φ given I) both images' densities are "
        "multiplied, and the least expected entropy is recommended.",
        *notes,
    ]
    return "\n".join([*lines, "", *(f"- {note}" for note in explained)]) + "\n"


def _with_interval(cell: Mapping[Hashable, Any] | None, metric: str, figure: str, ends: str) -> str:
    if cell is None or not np.isfinite(cell[figure]):
        return "–"
    decimals = 3 if metric == "circular_variance" else 2
    value, low, high = (
        number(cell[name], decimals) for name in (figure, f"{ends}_low", f"{ends}_high")
    )
    return f"{value} ({low} to {high})"
