"""Inputs of the figures, and the example that several figures share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np
import pandas as pd

from nbv.core.circle.criteria import cost_unit
from nbv.data.depth_images import Codes, open_depth
from nbv.errors import UserError
from nbv.experiment.report.settings import (
    SUBJECT,
    Example,
    ReportSettings,
    choose_example,
    example_row,
    focus_unit,
    hardest_azimuth_deg,
)
from nbv.experiment.results import Unit
from nbv.files import existing
from nbv.style import MethodStyle, method_style
from nbv.tables.lookup import LookupTable

Key = TypeVar("Key")

_LONGEST_NAME = 16


@dataclass(frozen=True)
class FigureInputs:
    """The inputs of all figures; see `FigureKind.needs` for the inputs of a single figure.

    Attributes
    ----------
    evaluations : mapping of (category, elevation_deg) to pandas.DataFrame
        Frames of `results.load_evaluations`.
    settings : ReportSettings
        The choices of presentation.
    depth, objects : mapping of (category, elevation_deg) to Path
        Depth images, and the ids of their objects.
    lookups : mapping of (category, elevation_deg, fold) to Path
        The lookup tables of the method `SUBJECT`.
    """

    evaluations: Mapping[Unit, pd.DataFrame]
    settings: ReportSettings = field(default_factory=ReportSettings)
    depth: Mapping[Unit, Path] = field(default_factory=dict)
    objects: Mapping[Unit, Path] = field(default_factory=dict)
    lookups: Mapping[tuple[str, int, int], Path] = field(default_factory=dict)

    @property
    def focus(self) -> Unit:
        """The category and elevation of the detailed figures."""
        return focus_unit(self.evaluations, self.settings.focus_category)

    def views(self, unit: Unit, object_id: str | None = None) -> Codes:
        """Return one object's depth codes, (n_viewpoints, side, side); the first by default.

        Raises
        ------
        UserError
            If a file is missing or the object is unknown.
        """
        depth = _given(self.depth, unit, "depth images")
        images = open_depth(depth, _given(self.objects, unit, "objects of depth images"))
        if object_id is None:
            return np.asarray(images.codes[0])
        return np.asarray(images.of([object_id])[0])

    def lookup(self, fold: int) -> LookupTable:
        """Return the lookup table of the focus unit in one fold.

        Raises
        ------
        UserError
            If the subject follows no table, or its file is missing.
        """
        name = f"lookup table of {SUBJECT}"
        return LookupTable.load(existing(_given(self.lookups, (*self.focus, fold), name)))

    def methods(self, unit: Unit) -> tuple[str, ...]:
        """Return the methods of the settings that were evaluated for a unit, in order."""
        present = set(self.evaluations[unit]["method"].astype(str))
        return tuple(method for method in self.settings.methods if method in present)

    def style(self, method: str) -> MethodStyle:
        """Return the style of a method."""
        return method_style(method, self.settings.methods)


@dataclass(frozen=True)
class ExampleView:
    """The example object at the hardest initial azimuth, with the results of each method.

    The category's single-view error is largest at `azimuth_deg`; `estimate_deg` is the estimate
    from there. `views` (n_viewpoints, side, side) are the depth codes of all viewpoints, and
    `outcomes` the row of the evaluation by method.
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
        """The object, its category, fold and elevation."""
        category, elevation = self.unit
        fold = self.example.fold
        # An id may be a hash of 32 digits: eight are distinct, and Table 6 shows all.
        name = self.example.object_id
        short = name if len(name) <= _LONGEST_NAME else f"{name[:8]}…"
        return f"{short} ({category}, fold {fold}, elevation {elevation}°)"


def example_view(inputs: FigureInputs) -> ExampleView:
    """Return the example of Figs. 2, 3 and 7."""
    unit = inputs.focus
    frame = inputs.evaluations[unit]
    example = choose_example(frame)
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


@dataclass(frozen=True)
class CostWords:
    """The names of the criterion, the cost and the lookup table in figures.

    The paper's table is named after the spread that measures its ambiguity.
    """

    selects: str
    cost: str
    unit: str
    table: str


def cost_words(lookup: LookupTable) -> CostWords:
    """Return the names for a lookup table of any criterion."""
    unit = cost_unit(lookup.criterion, {"spread": lookup.spread})
    unit = "0–1" if unit == "1" else unit  # the range is more useful than "no unit"
    if lookup.criterion == "pose_ambiguity":
        spread = lookup.spread.replace("_", " ").capitalize()
        return CostWords("Ambiguity", "Ambiguity", unit, spread)
    name = lookup.criterion.replace("_", " ").capitalize()
    return CostWords(name, "Cost", unit, f"{name}: cost")


def _given(files: Mapping[Key, Path], key: Key, kind: str) -> Path:
    """Return the file of a key, or raise a UserError."""
    if key not in files:
        name = " ".join(map(str, key)) if isinstance(key, tuple) else key
        raise UserError(f"no {kind} for {name}; run that stage first")
    return files[key]
