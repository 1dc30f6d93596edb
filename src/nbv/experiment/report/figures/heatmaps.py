"""The lookup table as a picture: how spread the truth is, and which rotation costs least."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from nbv.experiment.report.figures.inputs import FigureInputs, cost_words
from nbv.robot.style import azimuth_axis, new_figure

_DECADES = 3.0


def lookup_maps(inputs: FigureInputs) -> Figure:
    """V[estimate, viewpoint] and A[estimate, δ], with the recommended δ of each estimate."""
    unit = inputs.focus
    folds = sorted(inputs.evaluations[unit]["fold"].unique())
    wanted = inputs.settings.example_fold
    fold = int(wanted if wanted in folds else folds[0])
    lookup = inputs.lookup(fold)
    words = cost_words(lookup)
    likelihood = np.asarray(lookup.viewpoint_likelihood, dtype=np.float64)
    cost = np.asarray(lookup.cost, dtype=np.float64)
    figure = new_figure(8.6, 4.1)
    left, right = figure.subplots(1, 2)
    half = 180 / likelihood.shape[0]
    extent = (-half, 360 - half, -half, 360 - half)
    top = likelihood.max()
    image: Any = {"origin": "lower", "extent": extent, "cmap": "cividis"}
    image |= {"interpolation": "none", "aspect": "auto"}
    shown = left.imshow(likelihood.T, norm=LogNorm(top / 10**_DECADES, top), **image)
    left.plot([0, 360], [0, 360], color="black", linewidth=1.0, linestyle=":")
    left.set_title("Viewpoint likelihood V[e, φ]")
    azimuth_axis(left, "True viewpoint φ (degrees)", vertical=True)
    figure.colorbar(shown, ax=left, label="Probability per bin (log scale)", extend="min")
    shown = right.imshow(cost.T, **image)
    n_bins = cost.shape[0]
    right.plot(
        np.arange(n_bins) * 360 / n_bins,
        lookup.recommended_delta_deg,
        linestyle="",
        marker="o",
        markersize=2.2,
        color="white",
        markeredgecolor="black",
        markeredgewidth=0.3,
    )
    right.set_title(f"{words.table} A[e, δ], dots: recommended")
    azimuth_axis(right, "Rotation δ (degrees)", vertical=True)
    figure.colorbar(shown, ax=right, label=f"{words.cost} ({words.unit}); lower is better")
    for axes in (left, right):
        azimuth_axis(axes, "Estimate e (degrees)")
        axes.grid(visible=False)
    figure.suptitle(f"Lookup table of {unit[0]}, elevation {unit[1]}°, fold {fold}", fontsize=10)
    return figure
