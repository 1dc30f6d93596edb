"""Table 1 as a picture: each category's methods, ours with intervals, the published values."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from nbv.experiment.report.forest import WIDTH_IN
from nbv.labels import method_label
from nbv.robot.style import RC, draw_estimate, label_rows, method_style, new_figure

_ROW_IN = 0.185


@mpl.rc_context(RC)
def table_picture(cells: pd.DataFrame) -> Figure:
    """Draw a table of MAE by row and method.

    Parameters
    ----------
    cells : DataFrame
        Of ``table1.csv``; see `nbv.experiment.report.cells`.
    """
    shown = cells[cells["metric"] == "mae"]
    methods = tuple(dict.fromkeys(shown["method"].astype(str)))
    rows = list(shown.groupby("row_label", sort=False))
    figure = new_figure(WIDTH_IN, _ROW_IN * (len(shown) + len(rows)) + 0.6)
    axes = figure.subplots()
    labels: list[str] = []
    headings = []
    for name, part in rows:
        headings.append(len(labels))
        labels.append(str(name))
        for found in part.to_dict("records"):
            ours = float(found["value"]), float(found["ci_low"]), float(found["ci_high"])
            style = method_style(str(found["method"]), methods)
            draw_estimate(axes, len(labels), style, ours, float(found["published"]))
            labels.append(method_label(str(found["method"])))
    label_rows(axes, labels, headings)
    axes.set_xlim(left=0)
    key = "filled: ours, 95 % interval"
    if np.isfinite(shown["published"]).any():
        key += "; open: the paper's"
    axes.set_xlabel(f"MAE (degrees)\n{key}")
    return figure
