#!/usr/bin/env python3
"""Write the pages' tables from docs/reference, between markers; with --check only compare."""

import re
import sys
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path

import pandas as pd

from nbv.labels import interval_text

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "docs/reference"
MARKED = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)

BUNDLE_ROWS = {
    "procedural mugs": "generated",
    "other people's meshes (ShapeNet)": "shapenet",
    "mug 1 (real), nearly level": "mug 1, nearly level",
    "mug 1 (real), from above": "mug 1, from above",
    "mug 2 (real), nearly level": "mug 2, nearly level",
    "mug 2 (real), from above, turntable zero 10° off": "mug 2, from above",
}
BUNDLE_COLUMNS = {
    "one": ("single", 1),
    "best fixed": ("best fixed", 2),
    "opposite": ("opposite", 2),
    "recommended": ("recommended", 2),
    "paper": ("paper's table, averaged", 2),
    "three, even": ("evenly spaced", 3),
    "three": ("recommended", 3),
}
AVERAGED = {
    "one view": ("none", "none"),
    "opposite, average": ("opposite", "average"),
    "T = L, likeliest smoothing, average": ("given_truth_likeliest", "average"),
    "T = L, average": ("given_truth", "average"),
    "T = V (Proposed), average": ("given_estimate", "average"),
    "T = L V, average": ("through_estimate", "average"),
    "fixed, posterior": ("fixed", "posterior"),
    "expected error, posterior": ("expected_error", "posterior"),
}
MULTIPLIED = {
    "one view": ("none", "none"),
    "T = V (Proposed), average": ("given_estimate", "average"),
    "opposite, product": ("opposite", "product"),
    "fixed, product": ("fixed", "product"),
    "expected error, product": ("expected_error", "product"),
}
CONFIRMATION_DATA = {"procedural": "embedded", "other people's": "real"}
CONFIRMATION_ESTIMATORS = {
    "regressors": {"networks": "", "linear": "-linear"},
    "classifiers": {"networks": "-classifier", "linear": "-linear_classifier"},
}

ROTATIONS = {
    "one view": "random_1",
    "two, random": "random_2",
    "two, opposite": "opposite_2",
    "two, recommended": "recommended_2",
}


def bold_least(values: Iterable[float | None], decimals: int) -> list[str]:
    """Return numbers as text, the least one in bold and a missing one as a dash."""
    texts = ["–" if value is None else f"{value:.{decimals}f}" for value in values]
    least = min(texts, key=lambda text: float(text.replace("–", "inf")))
    return [f"**{text}**" if text == least else text for text in texts]


def mae_cells(run: str, table: str) -> pd.DataFrame:
    """Return the mean absolute errors in a table of a reference run."""
    return pd.read_csv(REFERENCE / run / f"tables/{table}.csv").query("metric == 'mae'")


def table1() -> pd.DataFrame:
    """Table 1 of the paper: our value, and the published one in brackets."""
    cells = mae_cells("quick", "table1")
    rows = {}
    for label, row in cells.groupby("row_label", sort=False):
        both = zip(bold_least(row["value"], 2), row["published"], strict=True)
        rows[label] = [f"{ours} [{published:.2f}]" for ours, published in both]
    return pd.DataFrame(rows, index=["Single", "Random", "Opposite", "Proposed"]).T


def linear() -> pd.DataFrame:
    """MAE of every unit with a network for every fold, and with linear estimators, degrees."""
    columns = {}
    for method in ("single", "opposite", "proposed"):
        for label, run in {"network": "paper", "linear": "quick"}.items():
            tables = mae_cells(run, "table1"), mae_cells(run, "table2").query("row != 0")
            cells = pd.concat(tables).query("method == @method")
            of_mug = "Mug, " + cells["row_label"]
            names = cells["row_label"].where(cells["table"] == "table1", of_mug)
            rows = dict(zip(names, cells["value"].map("{:.1f}".format), strict=True))
            columns[f"{method.capitalize()}, {label}"] = rows
    return pd.DataFrame(columns)


def features() -> pd.DataFrame:
    """MAE of networks that start from the features, and less that of networks that do not."""
    found = pd.read_csv(REFERENCE / "warm-start/features.csv").query("method != 'random'")
    elevation = ", " + found["elevation_deg"].astype(str) + "°"
    found["unit"] = found["category"].str.capitalize() + elevation.where(
        found["elevation_deg"] > 0, ""
    )
    less = found[["difference_deg", "ci_low", "ci_high"]].itertuples(index=False)
    found["cell"] = [
        f"{error:.1f}; {interval_text(*row, decimals=1)}"
        for error, row in zip(found["features_deg"], less, strict=True)
    ]
    found["method"] = found["method"].str.capitalize()
    units, methods = found["unit"].unique(), found["method"].unique()
    return found.pivot_table("cell", "unit", "method", aggfunc="first").loc[units, methods]


def confirmation(kind: str, rows: Mapping[str, tuple[str, str]]) -> pd.DataFrame:
    """MAE over all categories and trainings, degrees."""
    found = pd.read_csv(REFERENCE / "confirmation/methods.csv")
    found = found.query("category == 'all' and n_views <= 2")
    mae = found.set_index(["dataset", "choice", "fusion"])["mae_deg"]
    columns = {
        f"{label}, {estimator}": bold_least(
            [mae.get((data + suffix, *method)) for method in rows.values()], 1
        )
        for label, data in CONFIRMATION_DATA.items()
        for estimator, suffix in CONFIRMATION_ESTIMATORS[kind].items()
    }
    return pd.DataFrame(columns, index=[*rows])


def bundle() -> pd.DataFrame:
    """MAE of the shipped bundle, degrees."""
    errors = pd.read_csv(REFERENCE / "bundles/errors.csv")
    mae = errors.groupby(["objects", "choice", "n_views"])["mae_deg"].mean()
    columns = {
        label: [f"{mae[objects, *view]:.1f}" for objects in BUNDLE_ROWS.values()]
        for label, view in BUNDLE_COLUMNS.items()
    }
    return pd.DataFrame(columns, index=[*BUNDLE_ROWS])


def focal_lengths() -> pd.DataFrame:
    """MAE of two views of real mugs without the recordings' offsets, degrees."""
    errors = pd.read_csv(REFERENCE / "bundles/focal_lengths.csv").query("n_views == 2")
    places = errors["sequence"].map({1: "nearly level", 2: "from above"})
    errors["recording"] = errors["object_id"].str.replace("mug", "mug ") + ", " + places
    by_choice = errors.pivot_table(
        index=["recording", "focal_px"], columns="choice", values="mae_without_offset_deg"
    )
    both = by_choice["recommended"].map("{:.1f}".format) + " / "
    cells = both + by_choice["opposite"].map("{:.1f}".format)
    table = cells.unstack("focal_px")  # noqa: PD010 - nothing to aggregate
    return table.rename(columns="{} px".format).rename_axis(None).sort_index(ascending=True)


def rotations(folder: str) -> pd.DataFrame:
    """Mean errors of an estimator in three dimensions, degrees, and numbers of views."""
    found = pd.read_csv(REFERENCE / folder / "rotations.csv").set_index(["group", "method"])
    error = found["error_deg"].map("{:.1f}".format)
    views, less = found["n_views"].map("{:.2f}".format), found["error_deg"] - found["less_chance"]
    rows = {}
    for group in found.index.unique("group"):
        stopped = group, "recommended_decision"
        fixed = [error[group, name] for name in ROTATIONS.values()]
        chance = f"{less[stopped]:.1f}"
        rows[group] = [*fixed, f"{error[stopped]} ({views[stopped]} views)", chance]
    columns = [*ROTATIONS, "until the decision", "stopped at random"]
    return pd.DataFrame(rows, index=columns).T.rename(index=str.capitalize)


def rotation_estimator() -> pd.DataFrame:
    """One view of the study's own estimators: log-likelihoods, and errors in degrees."""
    found = pd.read_csv(REFERENCE / "rotation-estimator/rotation_estimator.csv")
    columns = {
        "log-likelihood": found["log_likelihood"].map("{:.2f}".format),
        "at most": found["most"].map("{:.2f}".format).replace("nan", "–"),
        "mean error": found["error_deg"].map("{:.1f}".format),
        "median": found["median_deg"].map("{:.1f}".format),
        "> 30° (%)": (100 * found["above_30"]).map("{:.1f}".format),
    }
    return pd.DataFrame(columns).set_axis(found["object_id"].str.capitalize())


TABLES = {
    "table1": table1,
    "linear": linear,
    "features": features,
    "confirmation_regressors": partial(confirmation, "regressors", AVERAGED),
    "confirmation_classifiers": partial(confirmation, "classifiers", MULTIPLIED),
    "bundle": bundle,
    "focal_lengths": focal_lengths,
    "rotations": partial(rotations, "rotations"),
    "own_rotations": partial(rotations, "rotation-estimator"),
    "rotation_estimator": rotation_estimator,
}


def markdown(table: pd.DataFrame) -> str:
    """Return a table in Markdown, its numbers to the right."""
    lines = [["", *table.columns], ["---", *["---:"] * table.shape[1]]]
    lines += [[str(row.Index), *row[1:]] for row in table.itertuples()]
    return "\n" + "".join(f"| {' | '.join(cells)} |\n" for cells in lines) + "\n"


for page in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))):
    text = page.read_text("utf-8")
    fresh = MARKED.sub(lambda found: found[1] + markdown(TABLES[found[2]]()) + found[3], text)
    if fresh != text:
        if "--check" in sys.argv:
            sys.exit(f"{page}: a table differs from docs/reference; run make tables")
        page.write_text(fresh, "utf-8")
