"""One HTML page with everything: claims first, then tables, figures, settings and cost.

It needs nothing but itself: no scripts, no links outward, figures written into the page.
"""

from __future__ import annotations

import base64
from collections.abc import Hashable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup

from nbv.config import read_configuration
from nbv.experiments.results import load_object_ids
from nbv.files import existing, read_json, readable
from nbv.labels import category_label, interval_text, number
from nbv.paper.claim_text import VERDICT_RULES, by_run
from nbv.paper.statements import FAILS, HOLDS, NOT_RUN, UNDECIDED, VERDICTS
from nbv.paper.verdicts import read_claims
from nbv.reporting.paper.figures import FIGURES
from nbv.reporting.paper.tables import TABLES
from nbv.reporting.templating import HTML
from nbv.statistics.paired import UNIT_OF

_SECTIONS = {
    "claims": "The paper's claims",
    "tables": "Tables",
    "figures": "Figures",
    "comparisons": "Every comparison",
    "settings": "Settings",
    "runtime": "Running time",
}
_BADGES = {
    HOLDS: {"sign": "✓", "kind": "holds"},
    FAILS: {"sign": "✗", "kind": "fails"},
    UNDECIDED: {"sign": "?", "kind": "open"},
    NOT_RUN: {"sign": "–", "kind": "none"},
}
_UNKNOWN = "not recorded"
_STARTS = {
    "none": "each estimator starts from random weights",
    "elevations": "the lowest elevation starts from random weights, each other one from the "
    "elevation below",
    "categories": "each estimator starts from a network of all categories; the paper trains each "
    "category alone",
    "both": "the lowest elevation starts from a network of all categories, each other one from the "
    "elevation below; the paper trains each category alone",
}


def build_report(
    *,
    claims: Path,
    configuration: Path,
    provenance: Path,
    splits: Mapping[str, Path],
    tables: Mapping[str, Path],
    figures: Mapping[str, Path],
    runtime: Path,
) -> str:
    """Return the report of an experiment as one self-contained HTML page.

    Parameters
    ----------
    claims : path
        CSV of `nbv.reporting.paper.claims.claims_table`.
    configuration, provenance : path
        ``configuration.yaml`` and ``provenance.json`` of the run.
    splits : mapping of category to path
        Of every category that the configuration names.
    tables : mapping of name to path
        HTML fragments of `nbv.reporting.table.write_table`, in the order to show them. The
        paper's tables that are not among them are named as such.
    figures : mapping of name to path
        PNG files, likewise.
    runtime : path
        HTML fragment of `nbv.reporting.runtime.runtime_table`.

    Raises
    ------
    UserError
        If a file is missing.
    """
    judged = read_claims(claims).fillna({"note": "", "summary": "", "versus": ""})
    each = judged.drop_duplicates("id")
    run, not_run = by_run(judged)
    settings = read_configuration(existing(configuration).parent, ("density", "estimator"))
    made_with = read_json(provenance)
    return HTML.get_template("report.html.j2").render(
        title=f"Best next viewpoint: experiment {settings['name']}",
        repairs=_repairs(settings["density"]),
        sections=_SECTIONS,
        badges=_BADGES,
        run_facts=[*_run_facts(settings, splits), ("Commit", made_with.get("commit") or _UNKNOWN)],
        claims_run=run.to_dict("records"),
        claims_not_run=not_run.to_dict("records"),
        tally=_tally(each["verdict"]),
        point_tally=_tally(each["point_verdict"]),
        verdict_rules=VERDICT_RULES,
        tables={name: _fragment(path) for name, path in tables.items()},
        absent_tables=[name for name in TABLES if name not in tables],
        figures=[_figure(name, path) for name, path in figures.items()],
        absent_figures=[name for name in FIGURES if name not in figures],
        comparisons=[_comparison(part) for part in judged.to_dict("records")],
        machine_facts=list(_machine_facts(made_with)),
        configuration=configuration.read_text(encoding="utf-8").strip(),
        runtime=_fragment(runtime),
    )


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
    else:
        yield "Training", _STARTS[estimator["warm_start"]]


def _repairs(density: Mapping[str, Any]) -> str:
    """Say in which way Proposed is not the method as it is printed."""
    repairs = []
    if density["pose_likelihood"] == "given_estimate":
        repairs.append("the pose likelihood of Eq. 6 is given the estimate and not the truth")
    if len(density["bandwidths_deg"]) * len(density["pseudo_observations"]) > 1:
        repairs.append(
            "the smoothing is chosen by the errors of the decisions and not by the likelihood"
        )
    if min(density["pseudo_observations"]) > 0:
        repairs.append("each row of the density has uniform pseudo-observations")
    if not repairs:
        return "Proposed is the paper's method as it is printed."
    return (
        f"Proposed is the paper's method, repaired: {'; '.join(repairs)}. The command snakemake "
        "confirm compares it with the method as it is printed."
    )


def _machine_facts(provenance: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield "Python", provenance.get("python", _UNKNOWN)
    yield "Platform", provenance.get("platform", _UNKNOWN)
    packages = provenance.get("packages", {})
    yield "Packages", ", ".join(f"{name} {packages[name]}" for name in sorted(packages))


def _tally(verdicts: pd.Series) -> str:
    counts = verdicts.value_counts()
    words = ("hold", "do not hold", "are undecided", "were not run")
    return ", ".join(f"{counts.get(v, 0)} {w}" for v, w in zip(VERDICTS, words, strict=True))


def _fragment(path: Path) -> Markup:
    """Return HTML that `write_table` has escaped already."""
    with readable(path):
        return Markup(path.read_text(encoding="utf-8"))


def _figure(name: str, path: Path) -> dict[str, str]:
    data = base64.b64encode(existing(path).read_bytes()).decode("ascii")
    return {"name": name, "caption": FIGURES[name].caption, "data": data}


def _comparison(part: Mapping[Hashable, Any]) -> list[str]:
    """Return the row of one of the comparisons that claims are made of."""
    unit = UNIT_OF.get(str(part["statistic"]), "")
    value, versus = (
        f"{number(figure)}{unit}" if np.isfinite(figure) else "–"
        for figure in (part["value"], part["versus_value"])
    )
    difference = "–"
    if np.isfinite(part["difference"]):
        difference = interval_text(part["difference"], part["ci_low"], part["ci_high"])
    statistic = str(part["statistic"]).replace("_", " ")
    subject, other = part["subject"], part["versus"]
    return [part["id"], statistic, subject, value, other, versus, difference, part["part_verdict"]]
