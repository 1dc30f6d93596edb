"""The report: one HTML page with tables, claims, figures, settings and running time.

It needs no other file. Without scripts, it lacks the button that opens all claims.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
from markupsafe import Markup
from matplotlib.figure import Figure

from nbv.experiment.config import read_configuration
from nbv.experiment.paper.claims import CLAIMS
from nbv.experiment.paper.statements import (
    FAILS,
    HOLDS,
    NOT_RUN,
    STATISTIC_LABELS,
    UNDECIDED,
    VERDICT_RULES,
    VERDICTS,
    Comparison,
    by_run,
)
from nbv.experiment.paper.verdicts import read_claims
from nbv.experiment.report.figures import FIGURES
from nbv.experiment.report.forest import (
    ClaimRow,
    claim_figure,
    claims_forest,
    comparisons_of,
    deciding_comparison,
    table_picture,
)
from nbv.experiment.report.table import HTML
from nbv.experiment.results import load_object_ids
from nbv.experiment.statistics.paired import UNIT_OF
from nbv.files import existing, read_csv, read_json
from nbv.labels import category_label, interval_text, number
from nbv.style import AGAINST, FOR, GRID, INK, MUTED, OPEN, SHADE, saved_as

_COLOURS: Mapping[str, str] = {
    INK: "var(--ink)",
    "#000000": "var(--ink)",
    MUTED: "var(--muted)",
    GRID: "var(--line)",
    SHADE: "var(--shade)",
    FOR: "var(--holds)",
    OPEN: "var(--open)",
    AGAINST: "var(--fails)",
    "#ffffff": "var(--page)",
}
_COLOUR = re.compile("|".join(_COLOURS))
_FILE_TAGS = {"metadata", "style"}
_DECIMALS = re.compile(r"(\.\d\d)\d+(?!e)")
_NAMED = re.compile(r"(?<=url\(#)")


def svg_text(figure: Figure) -> str:
    """Return a figure as the text of an SVG file, always the same for the same figure."""
    return saved_as(figure, "svg").decode("utf-8")


def inline_svg(text: str, name: str, label: str) -> Markup:
    """Return an SVG file's text as an ``svg`` element of a page, which scales with its container.

    Element ids have the prefix `name`, which keeps those of several figures apart; `label` is the
    description for screen readers. Ink, grid, paper and verdicts use the page's custom properties
    for colours, such as ``--ink``; the colours of methods stay.
    """
    root = ElementTree.fromstring(text)
    for parent in root.iter():
        for child in [element for element in parent if _local(element.tag) in _FILE_TAGS]:
            parent.remove(child)
        parent.tag = _local(parent.tag)
        parent.attrib = {
            _local(key): _page_attribute(_local(key), value, name)
            for key, value in parent.attrib.items()
        }
    root.attrib = {"viewBox": root.attrib["viewBox"], "width": root.attrib["width"]}
    root.attrib |= {"class": "drawing", "role": "img", "aria-label": label}
    return Markup(ElementTree.tostring(root, encoding="unicode"))


def _local(name: str) -> str:
    return name.rpartition("}")[2]


def _page_attribute(key: str, value: str, name: str) -> str:
    if key == "id":
        return f"{name}-{value}"
    if key in ("d", "transform"):
        return _DECIMALS.sub(r"\1", value.replace("\n", ""))
    if key == "style":
        value = _COLOUR.sub(lambda match: _COLOURS[match[0]], value)
    if key == "href" and value.startswith("#"):
        return f"#{name}-{value[1:]}"
    return _NAMED.sub(f"{name}-", value)


_SECTIONS = {
    "tables": "Tables",
    "claims": "The paper's claims",
    "figures": "Figures",
    "settings": "Settings",
    "runtime": "Running time",
}
_CLAIM = {claim.id: claim for claim in CLAIMS}
_MAIN_CLAIM = "outperforms-all"
_OPENING = "steps"
_BADGES = {
    HOLDS: {"sign": "✓", "kind": "holds"},
    FAILS: {"sign": "✗", "kind": "fails"},
    UNDECIDED: {"sign": "?", "kind": "open"},
    NOT_RUN: {"sign": "–", "kind": "none"},
}
_UNKNOWN = "not recorded"
_INTERPRETATIONS = {
    "given_estimate": "that of the truth given the estimate (T = V)",
    "given_truth": "that of the estimate given the truth (T = L)",
    "through_estimate": "that of the belief which a true viewpoint leads to (T = L V)",
}
_STARTS = {
    "none": "each estimator starts from random weights",
    "elevations": "the lowest elevation starts from random weights, each other one from the "
    "elevation below",
    "categories": "each estimator starts from a network of all categories; the paper trains each "
    "category alone",
    "both": "the lowest elevation starts from a network of all categories, each other one from the "
    "elevation below; the paper trains each category alone",
    "features": "each estimator starts from the network of the depth features, which other objects "
    "of all categories have trained",
}


def build_report(
    *,
    claims: Path,
    configuration: Path,
    provenance: Path,
    splits: Mapping[str, Path],
    tables: Mapping[str, Path],
    figures: Mapping[str, Path],
    table1: Path,
    runtime: Path,
    docs: str,
    caution: Sequence[str] = (),
) -> str:
    """Return the report of an experiment as one HTML page.

    Parameters
    ----------
    claims, table1 : path
        CSV files of `nbv.experiment.report.tables.claims_table` and of Table 1.
    configuration, provenance : path
        ``configuration.yaml`` and ``provenance.json`` of the run.
    splits : mapping of category to path
        The files of all categories in the configuration.
    tables : mapping of name to path
        HTML fragments of `nbv.experiment.report.table.write_table`, in the order of the page.
    figures : mapping of name to path
        SVG files, in the order of the page, which names those that are absent.
    runtime : path
        HTML fragment of `nbv.experiment.report.runtime.runtime_table`.
    docs : str
        Where the folder ``docs`` lies from the page, for links.
    caution : sequence of str
        Warnings that precede all numbers; see `nbv.experiment.plan`.

    Raises
    ------
    UserError
        If a file is missing.
    """
    judged = read_claims(claims).fillna({"note": "", "summary": "", "versus": ""})
    each = judged.drop_duplicates("id")
    run, not_run = by_run(judged)
    rows = comparisons_of(judged)
    settings = read_configuration(existing(configuration).parent, ("density", "estimator"))
    made_with = read_json(provenance)
    shown = [_figure(name, FIGURES[name].caption, _text(path)) for name, path in figures.items()]
    return HTML.get_template("page.html.j2").render(
        title=f"Best next viewpoint: experiment {settings['name']}",
        caution=caution,
        finding=_finding(rows, bool(caution)),
        opening=[
            *_opening(judged, read_csv(table1)),
            *(figure for figure in shown if figure["name"] == _OPENING),
        ],
        left_open=_left_open(settings["density"]),
        docs=docs,
        sections=_SECTIONS,
        badges=_BADGES,
        run_facts=[*_run_facts(settings, splits), ("Commit", made_with.get("commit") or _UNKNOWN)],
        claims_run=[_claim(each, rows[each["id"]]) for each in run.to_dict("records")],
        claims_not_run=[_claim(each, {}) for each in not_run.to_dict("records")],
        tally=_tally(each["verdict"]),
        point_tally=_tally(run["point_verdict"]),
        verdict_rules=VERDICT_RULES,
        # `write_table` has escaped them.
        tables={name: Markup(_text(path)) for name, path in tables.items()},
        runtime=Markup(_text(runtime)),
        figures=[figure for figure in shown if figure["name"] != _OPENING],
        absent_figures=[name for name in FIGURES if name not in figures],
        machine_facts=list(_machine_facts(made_with)),
        configuration=_text(configuration).strip(),
    )


def _finding(rows: Mapping[str, Mapping[Comparison, ClaimRow]], too_small: bool) -> str:
    """Return one sentence on whether the paper's conclusion holds."""
    conclusion = "The paper concludes that Proposed has a lower error than the three other methods"
    if too_small:
        return f"{conclusion}. This run is too small to judge that, whatever is said below."
    if _MAIN_CLAIM not in rows:
        return (
            f"{conclusion}. That is about its five categories together, which this run does not "
            "have."
        )
    part = deciding_comparison(_CLAIM[_MAIN_CLAIM], rows[_MAIN_CLAIM])
    row = rows[_MAIN_CLAIM][part]
    words = {HOLDS: "holds", FAILS: "does not hold", UNDECIDED: "is undecided"}[row["verdict"]]
    rival = str(row["versus"]).split(" (")[0]
    difference = interval_text(row["difference"], row["ci_low"], row["ci_high"])
    return (
        f"{conclusion}. Here this {words}: over all categories, the mean error of Proposed is "
        f"{number(row['value'])}°, that of {rival} {number(row['versus_value'])}°; the difference "
        f"is {difference} degrees."
    )


def _opening(judged: pd.DataFrame, table1: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Yield the opening pictures of the page, except for the figure of the method."""
    published = " Open: as published." if table1["published"].notna().any() else ""
    caption = (
        "Table 1 as a picture. Filled: our mean absolute error (MAE) by category and method, with "
        f"its 95 % interval over objects.{published} Single is one view; the others rotate the "
        "camera and average two estimates: after a random rotation, half a turn, or the rotation "
        "that the table proposes. All see the same objects, so their differences are known better "
        "than these intervals say."
    )
    yield _figure("table1-picture", caption, svg_text(table_picture(table1)))
    if (judged["verdict"] != NOT_RUN).any():
        caption = (
            "The paper's claims. By how much the comparison that decides a claim favours it, with "
            "its 95 % interval, on a square-root scale: a claim holds where all of the interval is "
            "right of 0, does not hold where all of it is left. pAUC: 100 less the mean error, "
            "where an error above 100° counts as 100. σ: standard deviation over folds. Groups: "
            "quarters of the circle of first views."
        )
        yield _figure("claims-forest", caption, svg_text(claims_forest(judged)))


def _claim(summary: ClaimRow, rows: Mapping[Comparison, ClaimRow]) -> dict[Hashable, Any]:
    """Return the page's entry for a claim; it has no rows where the claim was not run."""
    claim = _CLAIM[summary["id"]]
    shown: dict[Hashable, Any] = {**summary, "title": claim.title, "svg": None, "comparisons": []}
    if rows:
        label = f"{claim.title}: {summary['verdict']}. {summary['summary']}"
        drawn = svg_text(claim_figure(claim, rows))
        shown["svg"] = inline_svg(drawn, f"claim-{claim.id}", label)
        shown["comparisons"] = [_comparison(row) for row in rows.values()]
    return shown


def _run_facts(
    settings: Mapping[str, Any], splits: Mapping[str, Path]
) -> Iterator[tuple[str, str]]:
    labels = {category: category_label(category) for category in settings["categories"]}
    objects = [f"{text} {len(load_object_ids(splits[name]))}" for name, text in labels.items()]
    elevations = [
        f"{text} {', '.join(f'{degrees}°' for degrees in settings['elevations_deg'][name])}"
        for name, text in labels.items()
    ]
    yield "Data set", settings["dataset"]["source"]
    yield "Objects", "; ".join(objects)
    yield "Elevations", "; ".join(elevations)
    estimator = settings["estimator"]
    if pairs := estimator.get("pairs"):
        yield "Estimates", f"of another program, from {pairs}"
    elif start := estimator.get("warm_start"):
        yield "Training", _STARTS[start]
    else:
        yield (
            "Training",
            "none: estimators are linear in depth features that were trained on other objects; the "
            "paper trains a network for every fold",
        )


def _left_open(density: Mapping[str, Any]) -> str:
    """Return one sentence on how Proposed decides what the paper leaves open."""
    given = _INTERPRETATIONS[density["pose_likelihood"]]
    widths, alphas = density["bandwidths_deg"], density["pseudo_observations"]
    if len(widths) * len(alphas) > 1:
        smoothing = (
            "the smoothing and the pseudo-observations are those whose decisions err least on "
            "calibration objects"
        )
    else:
        smoothing = (
            f"the smoothing is {widths[0]:g}°, and a row of the density has {alphas[0]:g} "
            "pseudo-observations"
        )
    return (
        "The paper leaves some choices open. In Proposed, the pose likelihood of Eq. 6 is "
        f"{given}; {smoothing}."
    )


def _machine_facts(provenance: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield "Python", provenance.get("python", _UNKNOWN)
    yield "Platform", provenance.get("platform", _UNKNOWN)
    packages = provenance.get("packages", {})
    yield "Packages", ", ".join(f"{name} {packages[name]}" for name in sorted(packages))


def _tally(verdicts: pd.Series) -> str:
    counts = verdicts.value_counts()
    singular = ("holds", "does not hold", "is undecided", "was not run")
    plural = ("hold", "do not hold", "are undecided", "were not run")
    words = zip(VERDICTS, singular, plural, strict=True)
    parts = [f"{counts[v]} {a if counts[v] == 1 else b}" for v, a, b in words if v in counts]
    return ", ".join(parts)


def _text(path: Path) -> str:
    return existing(path).read_text(encoding="utf-8")


def _figure(name: str, caption: str, drawn: str) -> dict[str, Any]:
    return {"name": name, "caption": caption, "svg": inline_svg(drawn, name, caption)}


def _comparison(part: ClaimRow) -> list[str]:
    """Return the cells of one comparison of a claim."""
    unit = UNIT_OF.get(str(part["statistic"]), "")
    value, versus = (_with_unit(part[key], unit) for key in ("value", "versus_value"))
    printed, printed_versus = (
        _with_unit(part[key], unit) for key in ("published_value", "published_versus_value")
    )
    difference = "–"
    if np.isfinite(part["difference"]):
        difference = interval_text(part["difference"], part["ci_low"], part["ci_high"])
    statistic = STATISTIC_LABELS.get(str(part["statistic"]), "outliers")
    compared = f"{part['subject']}, {part['versus']}"
    published = "–" if printed == "–" else f"{printed}, {printed_versus}"
    return [
        compared, statistic, f"{value}, {versus}", difference, published, part["part_verdict"]
    ]  # fmt: skip


def _with_unit(value: float, unit: str) -> str:
    return f"{number(value)}{unit}" if np.isfinite(value) else "–"
