from __future__ import annotations

import pandas as pd

from nbv.recommendation.criteria import FOR_MORE_VIEWS
from nbv.reporting.extensions import curves


def curve_of(methods):
    rows = [("mug", method, views, 9.0 / views) for method in methods for views in (1, 2, 3)]
    return pd.DataFrame(rows, columns=["category", "method", "n_views", "value"])


def test_curves_are_drawn_in_the_houses_style():
    """Wherever they are called from: the spines that the style takes away are gone."""
    axes = curves.sequences(curve_of(["random"])).axes[0]
    assert not axes.spines["top"].get_visible()
    assert not axes.spines["right"].get_visible()


def test_the_legend_of_a_single_panel_stays_inside_the_figure():
    methods = ["random", "bisecting", "evenly_spaced", *FOR_MORE_VIEWS]
    figure = curves.sequences(curve_of(methods))
    figure.draw_without_rendering()
    box = figure.legends[0].get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.width
    assert box.y0 >= 0
