"""Verdicts on the paper's claims, on our results and on the paper's own printed numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from nbv.experiment.paper import published, statements
from nbv.experiment.paper.claims import CLAIMS
from nbv.experiment.paper.statements import (
    VERDICTS,
    Claim,
    Comparison,
    FreeOfOutliers,
    Term,
    Verdict,
    combine_statement,
    summarise,
    term_text,
)
from nbv.experiment.results import Unit
from nbv.experiment.statistics import paired
from nbv.experiment.statistics.paired import Estimate, PairedErrors, Resampler
from nbv.files import check_columns, damaged, read_csv

PAPER_VERDICTS: Mapping[Verdict, str] = {
    statements.HOLDS: "bear it out",
    statements.FAILS: "contradict it",
    statements.UNDECIDED: "leave it open",
    statements.NOT_RUN: "not printed",
}

CLAIM_COLUMNS = (
    "id",
    "section",
    "sentence",
    "compared",
    "verdict",
    "point_verdict",
    "published_verdict",
    "summary",
    "note",
)
PART_COLUMNS = (
    "part",
    "statistic",
    "subject",
    "versus",
    "value",
    "versus_value",
    "difference",
    "ci_low",
    "ci_high",
    "part_verdict",
    "published_value",
    "published_versus_value",
    "n_objects",
)


def evaluate_claims(
    evaluations: Mapping[Unit, pd.DataFrame],
    rng: np.random.Generator,
    n_resamples: int = 2000,
    claims: Sequence[Claim] = CLAIMS,
) -> pd.DataFrame:
    """Evaluate every claim; see `nbv.experiment.paper.statements` for the rules.

    Evaluations are those of `results.load_evaluations`; claims on absent units are ``not run``. The
    generator seeds the object resamples, which all comparisons share: ``default_rng(seed)`` gives
    the same intervals as the tables of ``ReportSettings(seed=seed)``.

    Returns
    -------
    pandas.DataFrame
        Tidy: one row per comparison, `CLAIM_COLUMNS` (the same for all parts of a claim) and
        `PART_COLUMNS`. ``point_verdict`` judges our values without their intervals, as the paper
        judges its own. ``difference`` is subject minus versus, in degrees or percent,
        with its 95 % interval over objects, whatever direction the claim asks for.
    """
    evaluator = _Evaluator(evaluations, Resampler.seeded(rng, n_resamples))
    rows: list[dict[str, Any]] = []
    for claim in claims:
        parts = statements.leaves(claim.statement)
        measured = {part: evaluator.measure(part) for part in parts}
        verdicts = {leaf: row["part_verdict"] for leaf, row in measured.items()}
        points = {part: _point_verdict(part, row) for part, row in measured.items()}
        printed = {part: _published_verdict(part) for part in parts}
        shared = {
            "id": claim.id,
            "section": claim.section,
            "sentence": claim.sentence,
            "compared": claim.compared,
            "verdict": combine_statement(claim.statement, verdicts),
            "point_verdict": combine_statement(claim.statement, points),
            "published_verdict": PAPER_VERDICTS[combine_statement(claim.statement, printed)],
            "summary": summarise(claim.statement, measured),
            "note": claim.note,
        }
        rows += [shared | {"part": index} | measured[part] for index, part in enumerate(parts, 1)]
    return pd.DataFrame(rows, columns=[*CLAIM_COLUMNS, *PART_COLUMNS])


def read_claims(path: str | Path) -> pd.DataFrame:
    """Read a CSV file of `evaluate_claims` for the paper's claims.

    Raise UserError where the file cannot be read, or lacks a column, a claim or one of its
    comparisons.
    """
    frame = read_csv(path)
    check_columns(path, frame, (*CLAIM_COLUMNS, *PART_COLUMNS))
    read = set(zip(frame["id"], frame["part"], strict=True))
    planned = {
        (claim.id, part + 1)
        for claim in CLAIMS
        for part in range(len(statements.leaves(claim.statement)))
    }
    if absent := sorted(planned - read):
        raise damaged(path, f"comparison {absent[0][1]} of claim {absent[0][0]!r} is missing")
    check_verdicts(path, [*frame["verdict"], *frame["point_verdict"]])
    return frame


def check_verdicts(path: str | Path, values: Iterable[str]) -> None:
    """Raise UserError where a value is not a verdict."""
    if unknown := sorted(set(values) - set(VERDICTS), key=str):
        raise damaged(path, f"{str(unknown[0])[:40]!r} is not a verdict")


class _Evaluator:
    """Measures comparisons, with a cache of samples and estimates."""

    def __init__(self, evaluations: Mapping[Unit, pd.DataFrame], resampler: Resampler) -> None:
        self._evaluations = evaluations
        self._resampler = resampler
        self._samples: dict[Unit, PairedErrors] = {}
        self._estimates: dict[tuple[str, Term], Estimate | None] = {}

    def measure(self, part: Comparison) -> dict[str, Any]:
        """Return the values of one comparison by `PART_COLUMNS`."""
        if isinstance(part, FreeOfOutliers):
            return self._measure_outliers(part)
        a, b = self._estimate(part.statistic, part.a), self._estimate(part.statistic, part.b)
        row = {
            "statistic": part.statistic,
            "subject": term_text(part.a),
            "versus": term_text(part.b),
            "part_verdict": statements.NOT_RUN,
            "published_value": _published(part.statistic, part.a),
            "published_versus_value": _published(part.statistic, part.b),
        }
        if a is None or b is None:
            return row
        difference = a.minus(b)
        samples = self._sample(part.a), self._sample(part.b)
        fewest = min(paired.fewest_resampled(part.statistic, sample) for sample in samples)
        verdict = statements.interval_verdict(part, difference.low, difference.high)
        return row | {
            "value": a.value,
            "versus_value": b.value,
            **difference.columns("difference", "ci"),
            "part_verdict": statements.if_enough(verdict, fewest),
            "n_objects": samples[0].n_objects,
        }

    def _measure_outliers(self, part: FreeOfOutliers) -> dict[str, Any]:
        row: dict[str, Any] = {
            "statistic": "outliers_percent",
            "subject": term_text(part.a),
            "versus": f"upper quartile + {statements.TUKEY_FACTOR} × interquartile range",
            "part_verdict": statements.NOT_RUN,
        }
        if not self._present(part.a):
            return row
        sample = self._sample(part.a)
        errors = sample.errors_deg[part.a.method]
        lower, upper = np.quantile(errors, [0.25, 0.75])
        fence = float(upper + statements.TUKEY_FACTOR * (upper - lower))
        percent = 100.0 * float(np.mean(errors > fence))
        verdict = statements.FAILS if percent > 0 else statements.HOLDS
        fewest = paired.fewest_resampled("outliers_percent", sample)
        return row | {
            "value": percent,
            "versus_value": fence,
            "part_verdict": statements.if_enough(verdict, fewest),
            "n_objects": sample.n_objects,
        }

    def _estimate(self, statistic: str, term: Term) -> Estimate | None:
        key = (statistic, term)
        if key not in self._estimates:
            sample = self._sample(term) if self._present(term) else None
            self._estimates[key] = (
                paired.estimate(statistic, sample, term.method, self._resampler)
                if sample and sample.n_images
                else None
            )
        return self._estimates[key]

    def _present(self, term: Term) -> bool:
        return all(
            unit in self._evaluations and term.method in self._unit(unit).errors_deg
            for unit in term.units
        )

    def _unit(self, unit: Unit) -> PairedErrors:
        if unit not in self._samples:
            self._samples[unit] = paired.pair_methods(self._evaluations[unit], unit[0])
        return self._samples[unit]

    def _sample(self, term: Term) -> PairedErrors:
        units = [self._unit(unit) for unit in term.units]
        sample = units[0] if len(units) == 1 else paired.pool(units)
        if term.group is not None:
            sample = sample.select(paired.viewpoint_group(sample.initial_deg) == term.group)
        if term.fold is not None:
            sample = sample.select(sample.folds == term.fold)
        if term.initial_deg:
            sample = sample.select(np.isin(sample.initial_deg, term.initial_deg))
        return sample


def _published(statistic: str, term: Term) -> float:
    """Return the published value of a term; pooled categories are the mean of their rows."""
    return float(np.mean([_published_unit(statistic, term, unit) for unit in term.units]))


def _published_unit(statistic: str, term: Term, unit: Unit) -> float:
    category, elevation = unit
    metric = statistic.removesuffix("_sigma")
    if term.initial_deg or metric not in ("mae", "pauc"):
        return math.nan
    if term.group is not None:
        table, row = "table5", str(term.group)
    elif term.fold is not None:
        table, row = "table7", str(term.fold)
    elif statistic.endswith("_sigma"):
        table, row = "table7", published.SIGMA_ROW
    elif category == published.FOCUS_CATEGORY:
        # Tables 1 and 3 print fold 2 for the mug; these are the averages over folds.
        table, row = ("table2" if metric == "mae" else "table4"), str(elevation)
    else:
        table, row = ("table1" if metric == "mae" else "table3"), category
    return published.published_value(table, metric, row, term.method)


def _published_verdict(part: Comparison) -> Verdict:
    if isinstance(part, FreeOfOutliers):
        return statements.NOT_RUN
    a, b = _published(part.statistic, part.a), _published(part.statistic, part.b)
    return statements.interval_verdict(part, a - b, a - b)


def _point_verdict(part: Comparison, row: Mapping[str, Any]) -> Verdict:
    if row["part_verdict"] == statements.NOT_RUN:
        return statements.NOT_RUN
    if isinstance(part, FreeOfOutliers):
        return statements.FAILS if row["value"] > 0 else statements.HOLDS
    return statements.interval_verdict(part, row["difference"], row["difference"])
