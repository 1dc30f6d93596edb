"""One HTML page with everything: claims first, then tables, figures, settings and cost."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from nbv.config import read_configuration
from nbv.experiments.results import load_object_ids
from nbv.files import existing, read_csv
from nbv.labels import category_label, number
from nbv.paper.claim_text import VERDICT_RULES, by_run
from nbv.paper.statements import VERDICTS
from nbv.provenance import read_provenance
from nbv.reporting import page
from nbv.reporting.markdown import markdown_to_html
from nbv.reporting.page import escape
from nbv.reporting.paper.figures import FIGURES
from nbv.reporting.paper.tables import TABLES
from nbv.reporting.runtime import load_runtime, runtime_markdown
from nbv.statistics.paired import UNIT_OF

_CONTENTS = (
    ("claims", "The paper's claims"),
    ("tables", "Tables"),
    ("figures", "Figures"),
    ("comparisons", "Every comparison"),
    ("settings", "Settings"),
    ("runtime", "Running time"),
)


def build_report(root: str | Path) -> str:
    """Return the report of an experiment as one self-contained HTML page.

    Reads what earlier stages wrote under `root`: ``claims.csv``, ``tables/*.md``,
    ``figures/*.png``, ``splits/``, ``configuration.yaml``, ``provenance.json`` and
    ``benchmarks/``. Tables and figures that are absent are named as such.

    Parameters
    ----------
    root : path
        ``results/<experiment>``.

    Raises
    ------
    UserError
        If the claims, the configuration or the provenance are missing, or the splits of a
        category that the configuration names.
    """
    root = Path(root)
    claims = read_csv(existing(root / "claims.csv")).fillna(
        {"note": "", "summary": "", "versus": ""}
    )
    settings = read_configuration(root)
    configuration = (root / "configuration.yaml").read_text(encoding="utf-8")
    existing(root / "provenance.json")
    provenance = read_provenance(root)
    title = f"Best next viewpoint: experiment {settings['name']}"
    links = "".join(f'<li><a href="#{key}">{escape(text)}</a></li>' for key, text in _CONTENTS)
    bodies = {
        "claims": _claims(claims),
        "tables": _tables(root),
        "figures": _figures(root),
        "comparisons": _comparisons(claims),
        "settings": _settings(configuration, provenance),
        "runtime": _runtime(root, settings),
    }
    return page.page(
        title,
        [
            f"<header><h1>{escape(title)}</h1>",
            page.facts(_facts(root, settings, provenance)),
            "</header>",
            f'<nav aria-label="Contents"><ul>{links}</ul></nav>',
            "<main>",
            *(page.section(key, text, bodies[key]) for key, text in _CONTENTS),
            "</main>",
        ],
    )


def _facts(
    root: Path, settings: Mapping[str, Any], provenance: Mapping[str, Any]
) -> list[tuple[str, str]]:
    categories = settings["categories"]
    objects = [f"{category_label(c)} {len(load_object_ids(root, c))}" for c in categories]
    elevations = [
        f"{category_label(c)} {', '.join(f'{e}°' for e in settings['elevations_deg'][c])}"
        for c in categories
    ]
    return [
        ("Data set", str(settings["dataset"]["source"])),
        ("Objects", "; ".join(objects)),
        ("Elevations", "; ".join(elevations)),
        ("Commit", str(provenance.get("commit") or "not recorded")),
    ]


def _claims(claims: pd.DataFrame) -> list[str]:
    each = claims.drop_duplicates("id")
    run, absent = by_run(claims)
    parts = [
        f"<p>Of {len(each)} checkable sentences, {_tally(each['verdict'])}. Judged as the paper "
        f"judges its own figures, by point estimates alone: {_tally(each['point_verdict'])}.</p>"
    ]
    if len(run):
        parts.append(_claim_table(run))
    if len(absent):
        summary = f"<summary>Not run: {len(absent)} of {len(each)}</summary>"
        parts.append(f"<details>{summary}{_claim_table(absent)}</details>")
    return [*parts, page.notes(VERDICT_RULES)]


def _claim_table(claims: pd.DataFrame) -> str:
    rows = []
    for claim in claims.to_dict("records"):
        note = f'<br><span class="muted">{escape(claim["note"])}</span>' if claim["note"] else ""
        figures = "<br>".join(escape(text) for text in str(claim["summary"]).split("; "))
        rows.append(
            [
                f"{escape(claim['section'])}",
                f'{escape(claim["sentence"])}<br><span class="muted">{escape(claim["compared"])}'
                f"</span>{note}",
                f"{page.badge(claim['verdict'])}<br>"
                f'<span class="muted">by point estimates: {escape(claim["point_verdict"])}</span>',
                figures,
                escape(claim["published_verdict"]),
            ]
        )
    header = ("Sec.", "The paper says", "Verdict", "Our figures", "Its own figures")
    return page.table(header, rows, "text")


def _tally(verdicts: pd.Series) -> str:
    counts = verdicts.value_counts()
    words = ("hold", "do not hold", "are undecided", "were not run")
    return ", ".join(f"{counts.get(v, 0)} {w}" for v, w in zip(VERDICTS, words, strict=True))


def _tables(root: Path) -> list[str]:
    parts, absent = [], []
    for name in TABLES:
        path = root / "tables" / f"{name}.md"
        if not path.is_file():
            absent.append(name)
            continue
        text = path.read_text(encoding="utf-8")
        title = text.splitlines()[0].removeprefix("## ")
        parts += [f'<h3 id="{name}">{escape(title)}</h3>', markdown_to_html(text, escape)]
    return parts + _absent(absent)


def _figures(root: Path) -> list[str]:
    parts, absent = [], []
    for name, kind in FIGURES.items():
        path = root / "figures" / f"{name}.png"
        if path.is_file():
            parts.append(page.inline_image(path, kind.caption))
        else:
            absent.append(name)
    return parts + _absent(absent)


def _absent(names: list[str]) -> list[str]:
    return [f"<p>Not made in this run: {escape(', '.join(names))}.</p>"] if names else []


def _comparisons(claims: pd.DataFrame) -> list[str]:
    """Return the parts that the compound claims are made of, for whoever checks one."""
    rows = []
    for part in claims.to_dict("records"):
        unit = UNIT_OF.get(str(part["statistic"]), "")
        interval = "–"
        if np.isfinite(part["difference"]):
            interval = (
                f"{number(part['difference'])} "
                f"({number(part['ci_low'])} to {number(part['ci_high'])})"
            )
        figures = [
            f"{number(part[column])}{unit}" if np.isfinite(part[column]) else "–"
            for column in ("value", "versus_value")
        ]
        rows.append(
            [
                escape(part["id"]),
                escape(str(part["statistic"]).replace("_", " ")),
                escape(part["subject"]),
                figures[0],
                escape(part["versus"]),
                figures[1],
                interval,
                escape(part["part_verdict"]),
            ]
        )
    header = (
        "Claim",
        "Statistic",
        "Better",
        "Value",
        "Than",
        "Value",
        "Difference (95 %)",
        "Verdict",
    )
    return [page.table(header, rows, "text")]


def _settings(configuration: str, provenance: Mapping[str, Any]) -> list[str]:
    machine = [
        ("Python", str(provenance.get("python", "not recorded"))),
        ("Platform", str(provenance.get("platform", "not recorded"))),
    ]
    packages = provenance.get("packages", {})
    versions = ", ".join(f"{name} {packages[name]}" for name in sorted(packages))
    return [
        page.facts([*machine, ("Packages", versions)]),
        f"<pre>{escape(configuration.strip())}</pre>",
    ]


def _runtime(root: Path, settings: Mapping[str, Any]) -> list[str]:
    """Return the table beside the others, or where it was not made, what it would say."""
    path = root / "tables" / "runtime.md"
    if path.is_file():
        text = path.read_text(encoding="utf-8")
    else:
        units = [(c, e) for c in settings["categories"] for e in settings["elevations_deg"][c]]
        text = runtime_markdown(load_runtime(root, units, settings["n_folds"]))
    if "|" not in text:
        return [f"<p>{escape(text.splitlines()[-1])}</p>"]
    return [markdown_to_html(text, escape)]
