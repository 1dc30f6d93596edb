"""Reference results: the part of a run under version control, with its settings."""

from __future__ import annotations

import logging
import shutil
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from nbv.data.sensors import IDEAL
from nbv.errors import UserError
from nbv.experiment.config import default_of, read_configuration
from nbv.experiment.paper.verdicts import check_verdicts
from nbv.experiment.report.settings import CELL_COLUMNS, TRANSFER
from nbv.experiment.run.provenance import read_provenance
from nbv.files import check_columns, existing, read_csv, replacing

log = logging.getLogger(__name__)

SettingDifference = tuple[str, Any, Any]
"""A dotted configuration key, the reference's value, the run's value; `UNSET` where absent."""

UNSET = "not set"

CellRecord = dict[str, Any]
"""One cell of a table: its `CELL_COLUMNS`."""

CELL_KEY = ("row", "method", "metric")
"""The columns that identify a cell within a table."""

# Paths, the other runs that are shown, and the hardware and precision of training: a difference in
# these retrains estimators, but the experiment is the same.
_SURROUNDINGS = frozenset(
    {
        "experiment",
        "name",
        "compared_runs",
        "dataset.root",
        "dataset.exclude_file",
        "estimator.device",
        "estimator.precision",
    }
)
# The paper's own tables do not depend on these.
_EXTENSION_KEYS = {TRANSFER, "extensions", "leaderboard_runs", "more_views", "rotations"}
_FREE_TRAVEL = {"travel_cost": 0.0, "max_travel_deg": 180.0}
_KEPT = ("tables/*.csv", "tables/*.md", "figures/figure[0-9].png")
_REQUIRED = (
    "claims.csv",
    "claims.md",
    "tables/runtime.csv",
    "tables/runtime.md",
    "configuration.yaml",
    "provenance.json",
)


def collect_reference(run: Path, reference: Path) -> list[Path]:
    """Copy the files of a finished run that a reviewer reads, byte for byte, as a reference.

    Tables, the paper's figures, claims, runtime, configuration and provenance: about 1 MB. The
    runtime goes to the folder above the tables. ``bench.json``, which ``python -m performance``
    writes to the folder of the runs, goes to the folder of the references if it exists. Tables and
    figures of the reference that the run lacks are removed; other files stay. Returns the files
    written, sorted. Raise UserError if the run lacks a file; the reference then stays
    unchanged.
    """
    copies = {reference / _kept_as(source.relative_to(run)): source for source in _sources(run)}
    bench = run.parent / "bench.json"
    if bench.is_file():
        copies[reference.parent / bench.name] = bench
    for stale in {old for pattern in _KEPT for old in reference.glob(pattern)} - copies.keys():
        stale.unlink()
    for target, source in copies.items():
        with replacing(target) as temporary:
            shutil.copyfile(source, temporary)
    commit = str(read_provenance(run).get("commit", "unknown"))
    if commit.endswith("-dirty") or commit == "unknown":
        log.warning("%s was made at %s, not at a clean commit", run, commit)
    size_mb = sum(target.stat().st_size for target in copies) / 1e6
    log.info(
        "%d files, %.1f MB, are now in %s",
        *(len(copies), size_mb, reference),
        extra={"for_terminal": True},
    )
    return sorted(copies)


def _sources(run: Path) -> Iterator[Path]:
    for name in _REQUIRED:
        yield existing(run / name)
    for pattern in _KEPT:
        files = sorted(path for path in run.glob(pattern) if path.stem != "runtime")
        if not files:
            raise UserError(f"{run / pattern}: no such file; finish the run first")
        yield from files


def _kept_as(name: Path) -> Path:
    return Path(name.name) if name.stem == "runtime" else name


def find_reference(folder: Path, configuration: Mapping[str, Any]) -> Path:
    """Return the reference that has the name of a run, such as ``docs/reference/<name>``.

    Raise UserError if none has that name, with the names that exist, or if it was made with other
    settings, with these.
    """
    name = str(configuration["name"])
    reference = folder / name
    if not reference.is_dir():
        kept = sorted(path.parent.name for path in folder.glob("*/configuration.yaml"))
        known = f"references: {', '.join(kept)}" if kept else "no reference exists yet"
        raise UserError(
            f"{reference} does not exist, so {name!r} cannot be compared ({known}); "
            "`snakemake --cores 2 reference` makes a reference from a run"
        )
    differences = differing_settings(read_configuration(reference), configuration)
    if differences:
        raise UserError(other_settings(reference, differences))
    return reference


def table_files(root: Path) -> list[Path]:
    """Return the tidy CSV of every table of cells, sorted; raise UserError if none exists."""
    files = sorted(path for path in (root / "tables").glob("*.csv") if path.stem != "runtime")
    if not files:
        raise UserError(f"{root / 'tables'} holds no tables; finish the run first")
    return files


def read_cells(path: Path) -> dict[tuple[str, ...], CellRecord]:
    """Read a table's cells by `CELL_KEY`, in their order.

    Raise UserError if a column is missing, or there are no cells.
    """
    frame = read_csv(path)
    check_columns(path, frame, CELL_COLUMNS)
    frame = frame.astype(dict.fromkeys(CELL_COLUMNS[:4], str))
    cells = [{name: cell[name] for name in CELL_COLUMNS} for cell in frame.to_dict("records")]
    return {tuple(cell[name] for name in CELL_KEY): cell for cell in cells}


def read_verdicts(root: Path) -> dict[str, str]:
    """Read the verdict of each claim of a run or reference."""
    path = root / "claims.csv"
    claims = read_csv(path)
    check_columns(path, claims, ("id", "verdict"))
    check_verdicts(path, claims["verdict"])
    claims = claims.drop_duplicates("id")
    return dict(zip(claims["id"], claims["verdict"], strict=True))


def differing_settings(
    reference: Mapping[str, Any], run: Mapping[str, Any]
) -> tuple[SettingDifference, ...]:
    """Return the settings that affect results and differ, in the reference's order."""
    differences = _differences(_relevant(reference), _relevant(run))
    return tuple(d for d in differences if d[0] not in _SURROUNDINGS)


def _relevant(configuration: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings that affect the tables which every run has."""
    kept = {key: value for key, value in configuration.items() if key not in _EXTENSION_KEYS}
    if kept.get("recommendation") == _FREE_TRAVEL:
        del kept["recommendation"]
    if kept.get("sensor", {}).get("name") == IDEAL:
        kept["sensor"] = {"name": IDEAL}
    return kept


def differing_surroundings(
    reference: Path, run: Path, known: Mapping[str, Any], ours: Mapping[str, Any]
) -> list[str]:
    """Return a line with the paths, hardware, commit and versions that differ."""
    settings = [d for d in _differences(known, ours) if d[0] in _SURROUNDINGS]
    made = list(_differences(read_provenance(reference), read_provenance(run)))
    texts = [setting_text((key.removeprefix("packages."), *rest)) for key, *rest in settings + made]
    return [f"made with: {', '.join(texts)}"] if texts else []


def other_settings(reference: Path, differences: Iterable[SettingDifference]) -> str:
    """Return the reason why a run cannot be expected to agree with a reference."""
    texts = ", ".join(setting_text(difference) for difference in differences)
    return f"settings differ from {reference}, so results will not agree: {texts}"


def setting_text(difference: SettingDifference) -> str:
    """Return a difference as ``key=run's value (reference: value)``."""
    key, theirs, mine = difference
    return f"{key}={mine} (reference: {theirs})"


def _differences(
    theirs: Mapping[str, Any], mine: Mapping[str, Any], prefix: str = ""
) -> Iterator[SettingDifference]:
    for key in dict.fromkeys([*theirs, *mine]):
        # A key that was added later has its default in the older configuration.
        otherwise = default_of(f"{prefix}{key}", UNSET)
        a, b = theirs.get(key, otherwise), mine.get(key, otherwise)
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            yield from _differences(a, b, f"{prefix}{key}.")
        elif a != b:
            yield f"{prefix}{key}", a, b
