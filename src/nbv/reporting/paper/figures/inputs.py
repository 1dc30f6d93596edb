"""What figures are made from, and the example that several of them share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.errors import UserError
from nbv.experiments import results
from nbv.experiments.results import Unit
from nbv.files import existing
from nbv.recommendation.lookup import LookupTable, load_lookup
from nbv.reporting.paper.examples import Example, choose_example, example_row, hardest_azimuth_deg
from nbv.reporting.settings import ReportSettings as ReadingSettings
from nbv.reporting.settings import focus_unit

Codes = NDArray[np.uint8]

_LONGEST_NAME = 16


@dataclass(frozen=True)
class FigureInputs:
    """Everything a figure may read.

    Attributes
    ----------
    root : Path
        ``results/<experiment>``; depth images, lookup tables and splits are read from it.
    evaluations : mapping of (category, elevation_deg) to pandas.DataFrame
        Frames of `results.load_unit`.
    settings : ReadingSettings
        What to show.
    """

    root: Path
    evaluations: Mapping[Unit, pd.DataFrame]
    settings: ReadingSettings = field(default_factory=ReadingSettings)

    @property
    def focus(self) -> Unit:
        """The category and elevation that the detailed figures are about."""
        return focus_unit(self.evaluations, self.settings)

    def views(self, unit: Unit, object_id: str | None = None) -> Codes:
        """Return one object's depth codes, (n_viewpoints, side, side); the first by default.

        Raises
        ------
        UserError
            If the unit was not rendered or has no such object.
        """
        images = results.load_depth(self.root, *unit)
        if object_id is None:
            return np.asarray(images[0])
        ids = results.load_object_ids(self.root, unit[0])
        if object_id not in ids:
            path = results.splits_path(self.root, unit[0])
            raise UserError(f"{path}: no object {object_id!r}; evaluate the category again")
        return np.asarray(images[ids.index(object_id)])

    def methods(self, unit: Unit) -> tuple[str, ...]:
        """Return the methods to show that were evaluated for a unit, in order."""
        present = set(self.evaluations[unit]["method"].astype(str))
        return tuple(method for method in self.settings.methods if method in present)


@dataclass(frozen=True)
class ExampleView:
    """The example object seen from the hardest initial azimuth, and what each method made of it.

    Attributes
    ----------
    unit, example : Unit, Example
        The object.
    azimuth_deg : int
        Its initial viewpoint: where the category's single-view error is largest.
    estimate_deg : float
        What the estimator answered there.
    views : (n_viewpoints, side, side) uint8
        Depth codes of every viewpoint of the object.
    outcomes : mapping of str to pandas.Series
        Each method's row of the evaluation.
    """

    unit: Unit
    example: Example
    azimuth_deg: int
    estimate_deg: float
    views: Codes
    outcomes: Mapping[str, pd.Series]

    def view(self, azimuth_deg: float) -> Codes:
        """Return the image from the viewpoint nearest to an azimuth."""
        n_views = self.views.shape[0]
        return np.asarray(self.views[round(azimuth_deg * n_views / 360) % n_views])

    @property
    def title(self) -> str:
        """Which object this is."""
        category, elevation = self.unit
        fold = self.example.fold
        # Hashes of 32 digits fill the line; eight tell objects apart, and Table 6 has all.
        name = self.example.object_id
        short = name if len(name) <= _LONGEST_NAME else f"{name[:8]}…"
        return f"{short} ({category}, fold {fold}, elevation {elevation}°)"


def example_view(inputs: FigureInputs) -> ExampleView:
    """Return the example of Figs. 2, 3 and 7."""
    unit = inputs.focus
    frame = inputs.evaluations[unit]
    example = choose_example(frame, inputs.settings)
    azimuth = hardest_azimuth_deg(frame)
    outcomes = {}
    for method in inputs.methods(unit):
        row = example_row(frame, example, method, azimuth)
        if row is not None:
            outcomes[method] = row
    if not outcomes:
        raise UserError(f"{unit[0]}: {example.object_id} was not evaluated from {azimuth} degrees")
    estimate = float(next(iter(outcomes.values()))["initial_estimate_deg"])
    views = inputs.views(unit, example.object_id)
    return ExampleView(unit, example, azimuth, estimate, views, outcomes)


def focus_lookup(inputs: FigureInputs, fold: int) -> LookupTable:
    """Return the focus category's lookup table of one fold."""
    path = results.lookup_path(inputs.root, *inputs.focus, fold, inputs.settings.criterion)
    return load_lookup(existing(path))


def spread_unit(spread: str) -> str:
    """Return the unit of an ambiguity that is a spread of that name."""
    return "nats" if spread == "entropy" else "0–1"
