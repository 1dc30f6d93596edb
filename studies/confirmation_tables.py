"""Tables and plots of the means of methods and their contrasts over all trainings."""

from __future__ import annotations

from collections.abc import Iterator

import matplotlib as mpl
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nbv.experiment.report.table import DECIDED, Cell, Part, Table, difference_cell
from nbv.labels import category_label, interval_text, number
from nbv.robot.style import AGAINST, FOR, INK, OPEN, RC, label_rows, new_figure
from studies.confirmation import ALL

_INTERVALS = (
    "Intervals are 95 % and contain the chance of objects and of trainings (docs/method.md)."
)
_DIFFERENCE = "Difference of MAE (degrees), below 0 is better"
_ROW_IN = 0.15
_PANEL_IN = 0.75
_BETTER, _UNDECIDED, _WORSE = "better", "undecided", "worse"
# Colour and marker, so that verdicts are distinct in grey and for colour-blind readers.
_VERDICTS = {_BETTER: (FOR, "o"), _UNDECIDED: (OPEN, "s"), _WORSE: (AGAINST, "X")}


def methods_table(means: pd.DataFrame) -> Table:
    """Return the means of `studies.confirmation.method_means` as a table.

    One row per choice and number of views, one column per fusion.
    """
    fusions = [fusion for fusion in dict.fromkeys(means["fusion"]) if fusion != "none"]
    parts = []
    for (dataset, category), part in means.groupby(["dataset", "category"], sort=False):
        rows = []
        for (n_views, choice), same_choice in part.groupby(["n_views", "choice"], sort=False):
            by_fusion = {str(row["fusion"]): _mean(row) for _, row in same_choice.iterrows()}
            shown = [by_fusion.get(fusion, "–") for fusion in fusions]
            if "none" in by_fusion:
                shown = [by_fusion["none"]] * len(fusions)
            rows.append((Cell(_choice(str(choice), int(str(n_views)))), *map(Cell, shown)))
        parts.append(Part(tuple(rows), f"{dataset}, {category_label(str(category))}"))
    title = "Every choice of view with every fusion"
    header = ("Choice", *(fusion.capitalize() for fusion in fusions))
    notes = ("MAE in degrees.", _INTERVALS)
    return Table("methods", title, title, means, header, tuple(parts), notes)


def beliefs_table(means: pd.DataFrame) -> Table:
    """Return the means of `studies.confirmation.belief_means` as a table."""
    parts = []
    for (dataset, category), part in means.groupby(["dataset", "category"], sort=False):
        rows = [
            (
                Cell(_choice(str(row["choice"]), int(row["n_views"]))),
                Cell(str(row["fusion"])),
                Cell(interval_text(row["log_likelihood"], row["low"], row["high"])),
                *(Cell(number(row[f"inside_{level}_percent"], 1)) for level in (50, 90)),
            )
            for _, row in part.iterrows()
        ]
        parts.append(Part(tuple(rows), f"{dataset}, {category_label(str(category))}"))
    title = "How well beliefs know the pose"
    header = ("Choice", "Fusion", "Log-likelihood", "Inside 50 %", "Inside 90 %")
    notes = (
        "Log-likelihood: of the true pose under the fused distribution, in nats per degree; a "
        "probability below 1e-12 counts as 1e-12.",
        "Inside: how often the densest region with 50 or 90 % of the probability holds the true "
        "pose, in percent. Below 50 or 90 the distribution is too sure.",
        _INTERVALS,
    )
    return Table("beliefs", title, title, means, header, tuple(parts), notes, n_text_columns=2)


def densities_table(densities: pd.DataFrame) -> Table:
    """Return the table of the densities that calibration objects chose, with counts.

    Parameters
    ----------
    densities : DataFrame
        ``dataset, category, shuffle, replicate, fold`` and
        `studies.factorial.DENSITY_COLUMNS`: one row per training and fold.
    """
    parts = []
    for (dataset, category), part in densities.groupby(["dataset", "category"], sort=False):
        rows = [
            (
                Cell(_choice(str(choice), 2)),
                Cell(str(fusion)),
                Cell(_counts(chosen["bandwidth_deg"], "°")),
                Cell(_counts(chosen["pseudo_observations"])),
                Cell(number(chosen["pairs_percent"].mean(), 0)),
            )
            for (choice, fusion), chosen in part.groupby(["choice", "fusion"], sort=False)
        ]
        n_folds = len(part.drop_duplicates(["shuffle", "replicate", "fold"]))
        heading = f"{dataset}, {category_label(str(category))} ({n_folds} folds)"
        parts.append(Part(tuple(rows), heading))
    title = "Densities that calibration objects chose"
    header = ("Choice", "Fusion", "Smoothing", "Pseudo-observations", "Pairs (%)")
    notes = (
        "Random, posterior: V and L of the fusion posterior, which all choices share; of Expected "
        "error, posterior it is the kernel of the regression.",
        "Each value with the number of folds that chose it.",
        "Pairs: the mean share of calibration pairs in a row of V; the rest are uniform "
        "pseudo-observations.",
    )
    return Table(
        "densities", title, title, densities, header, tuple(parts), notes, n_text_columns=2
    )


def _counts(values: pd.Series, unit: str = "") -> str:
    counts = values.value_counts().sort_index()
    return ", ".join(f"{value:g}{unit} ({n})" for value, n in counts.items())


def contrasts_table(contrasts: pd.DataFrame, single_trainings: pd.DataFrame) -> Table:
    """Return the contrasts of `studies.confirmation.method_contrasts` as a table.

    A note gives the agreement of single trainings (`studies.confirmation.training_contrasts`).
    """
    parts = []
    for (dataset, category), part in contrasts.groupby(["dataset", "category"], sort=False):
        rows = [
            (
                Cell(_contrast(str(row["contrast"]))),
                Cell(str(row["fusion"])),
                difference_cell(row["difference_deg"], row["low"], row["high"]),
                Cell(number(row["p_holm"], 3)),
            )
            for _, row in part.iterrows()
        ]
        heading = f"{dataset}, {category_label(str(category))}"
        sizes = part.iloc[0]
        heading += f" ({sizes['n_objects']} objects, {sizes['n_trainings']} trainings)"
        parts.append(Part(tuple(rows), heading))
    title = "Differences between methods"
    header = ("Contrast", "Fusion", "Difference of MAE", "p")
    notes = (
        f"Difference of MAE in degrees, paired by object and training. {DECIDED}",
        _INTERVALS,
        "p: of the primary contrasts (docs/protocol.md) over all categories as they are; of all "
        "others adjusted by Holm's method within their data set and category.",
        *_agreement(contrasts, single_trainings),
    )
    return Table(
        "contrasts", title, title, contrasts, header, tuple(parts), notes, n_text_columns=2
    )


def _agreement(contrasts: pd.DataFrame, single_trainings: pd.DataFrame) -> Iterator[str]:
    if single_trainings.empty:
        return
    each = single_trainings["difference_deg"]
    predicted = each.between(single_trainings["low"], single_trainings["high"])
    key = ["dataset", "category", "contrast", "fusion"]
    ends = single_trainings[key].merge(contrasts[[*key, "low", "high"]], on=key, how="left")
    overall = each.between(ends["low"], ends["high"])
    yield (
        f"Single trainings: of {len(each)} differences, {number(100 * predicted.mean(), 0)} % lie "
        "in the 95 % interval that the other trainings predict for one more training of the same "
        f"objects, and {number(100 * overall.mean(), 0)} % in the intervals above."
    )


@mpl.rc_context(RC)
def answers_figure(contrasts: pd.DataFrame) -> Figure:
    """Draw the answers over all categories to the questions of docs/protocol.md.

    A heading per question and fusion, and below it a row per data set.

    Parameters
    ----------
    contrasts : DataFrame
        From `studies.confirmation.method_contrasts`.

    Raises
    ------
    ValueError
        Where no contrast answers a question.
    """
    answers = _answers(contrasts)
    # A data set of one category has no rows over all.
    several = answers.groupby("dataset")["category"].transform("nunique") > 1
    answers = answers[~several | (answers["category"] == ALL)]
    labels: list[str] = []
    headings = []
    groups = answers.groupby(["question", "contrast", "fusion"], sort=False)
    figure = new_figure(7.4, _ROW_IN * (len(answers) + len(groups)) + 0.9)
    axes = figure.subplots()
    for (question, contrast, fusion), part in groups:
        headings.append(len(labels))
        labels.append(f"{question}. {_contrast(str(contrast))}, {fusion}")
        for _, row in part.iterrows():
            _draw_difference(axes, row, len(labels))
            text = interval_text(row["difference_deg"], row["low"], row["high"])
            axes.annotate(
                text,
                (1.02, len(labels)),
                xycoords=axes.get_yaxis_transform(),
                va="center",
                fontsize=8,
            )
            labels.append(str(row["dataset"]))
    axes.axvline(0.0, color=INK, linewidth=0.8)
    label_rows(axes, labels, headings)
    axes.set_xlabel(_DIFFERENCE)
    _verdict_key(figure, answers)
    return figure


@mpl.rc_context(RC)
def contrasts_figure(contrasts: pd.DataFrame) -> Figure:
    """Draw, by category, the contrasts that answer the questions of docs/protocol.md.

    A row per contrast and fusion, in the order of the questions, with a panel per data set.

    Parameters
    ----------
    contrasts : DataFrame
        From `studies.confirmation.method_contrasts`.

    Raises
    ------
    ValueError
        Where no contrast answers a question.
    """
    answers = _answers(contrasts)
    rows = [
        (key, [own for _, own in part.groupby("dataset", sort=False)])
        for key, part in answers.groupby(["question", "contrast", "fusion"], sort=False)
    ]
    n_columns = max(len(panels) for _, panels in rows)
    heights = [_PANEL_IN + _ROW_IN * max(map(len, panels)) for _, panels in rows]
    figure = new_figure(max(4.2 * n_columns, 5.4), sum(heights) + 0.5)
    cells = figure.subplots(
        len(rows), n_columns, squeeze=False, height_ratios=heights, sharex="row"
    )
    for panel_row, ((question, contrast, fusion), panels) in zip(cells, rows, strict=True):
        for i, (axes, part) in enumerate(zip(panel_row, panels, strict=False)):
            _forest(axes, part)
            asked = "" if i else f"{question}. {_contrast(str(contrast))}, {fusion}"
            axes.set_title(f"{asked}\n{part['dataset'].iloc[0]} (degrees)", loc="left")
        for spare in panel_row[len(panels) :]:
            spare.remove()
    for axes in cells[-1][: len(rows[-1][1])]:
        axes.set_xlabel(_DIFFERENCE)
    _verdict_key(figure, answers)
    return figure


def _answers(contrasts: pd.DataFrame) -> pd.DataFrame:
    answers = contrasts[contrasts["question"] > 0].sort_values(
        ["question", "fusion"], kind="stable"
    )
    if answers.empty:
        raise ValueError("no contrast answers a question")
    return answers


def _verdict_key(figure: Figure, contrasts: pd.DataFrame) -> None:
    verdicts = {_verdict(row) for _, row in contrasts.iterrows()}
    handles = [
        Line2D([], [], color=colour, marker=marker, linestyle="none", label=verdict)
        for verdict, (colour, marker) in _VERDICTS.items()
        if verdict in verdicts
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))


def _draw_difference(axes: Axes, row: pd.Series, y: int) -> None:
    colour, marker = _VERDICTS[_verdict(row)]
    axes.plot([row["low"], row["high"]], [y, y], color=colour, linewidth=1.4)
    axes.plot(row["difference_deg"], y, color=colour, marker=marker, markersize=5)


def _forest(axes: Axes, contrasts: pd.DataFrame) -> None:
    for y, (_, row) in enumerate(contrasts.iterrows()):
        _draw_difference(axes, row, y)
    axes.axvline(0.0, color=INK, linewidth=0.8)
    labels = [category_label(str(category)) for category in contrasts["category"]]
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")


def _verdict(row: pd.Series) -> str:
    return _WORSE if row["low"] > 0 else _BETTER if row["high"] < 0 else _UNDECIDED


def _mean(row: pd.Series) -> str:
    return interval_text(row["mae_deg"], row["low"], row["high"])


def _choice(choice: str, n_views: int) -> str:
    if choice == "none":
        return "One view"
    name = choice.replace("_", " ").capitalize()
    return name if n_views == 2 else f"{name}, {n_views} views"


def _contrast(name: str) -> str:
    return name.replace("_", " ").replace(" - ", " less ").capitalize()
