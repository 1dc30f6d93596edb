"""Reference results: what of a run is kept under version control, and what it was made with."""

from __future__ import annotations

import logging
import shutil
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from nbv.data.sensors import IDEAL
from nbv.errors import UserError
from nbv.experiment.config import default_of, read_configuration
from nbv.experiment.paper.verdicts import need_verdicts
from nbv.experiment.provenance import read_provenance
from nbv.experiment.report.settings import CELL_COLUMNS, TRANSFER
from nbv.files import existing, need_columns, read_csv, replacing

log = logging.getLogger(__name__)

SettingDifference = tuple[str, Any, Any]
"""A dotted configuration key, the reference's value, the run's value; `UNSET` where absent."""

UNSET = "not set"

Cell = dict[str, Any]
"""One cell of a table: its `CELL_COLUMNS`."""

CELL_KEY = ("row", "method", "metric")
"""What tells the cells of one table apart."""

# They say where files are, which other runs are shown, and on what hardware and in which precision
# an estimator is trained: that, too, is a retrained estimator and no other experiment.
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
# What the paper's own tables do not depend on.
_OF_EXTENSIONS = frozenset({TRANSFER, "extensions", "leaderboard_runs", "more_views"})
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
    """Copy what a reviewer reads of a run, byte for byte, to be committed as a reference.

    Tables, the paper's figures, claims, runtime, configuration and provenance: about 1 MB. The
    runtime goes to the folder above the tables. ``bench.json``, which ``python -m performance``
    writes to the folder of the runs, goes to that of the references where there is one. Tables and
    figures that the reference had and the run has not are removed; whatever else is there is left
    alone.

    Parameters
    ----------
    run : pathlib.Path
        ``results/<name>``, finished.
    reference : pathlib.Path
        ``docs/reference/<name>``.

    Returns
    -------
    list of pathlib.Path
        The files written, sorted.

    Raises
    ------
    UserError
        If the run lacks one of them; the reference is then as it was.
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
        log.warning("%s was not made at a clean commit but at %s", run, commit)
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
        found = sorted(path for path in run.glob(pattern) if path.stem != "runtime")
        if not found:
            raise UserError(f"{run / pattern}: no such file; finish the run first")
        yield from found


def _kept_as(name: Path) -> Path:
    return Path(name.name) if name.stem == "runtime" else name


def find_reference(folder: Path, configuration: Mapping[str, Any]) -> Path:
    """Return the reference to compare a run with, known before the run is made.

    Parameters
    ----------
    folder : pathlib.Path
        ``docs/reference``.
    configuration : mapping
        The run's; its ``name`` says which reference.

    Raises
    ------
    UserError
        If there is none of that name (those there are are named), or if it was made with other
        settings (they are named).
    """
    name = str(configuration["name"])
    found = folder / name
    if not found.is_dir():
        kept = sorted(path.parent.name for path in folder.glob("*/configuration.yaml"))
        there = f"there are: {', '.join(kept)}" if kept else "there is none yet"
        raise UserError(
            f"{found} does not exist, so that {name!r} cannot be compared ({there}); "
            "`snakemake --cores 2 reference` makes one of a run"
        )
    differences = differing_settings(read_configuration(found), configuration)
    if differences:
        raise UserError(other_settings(found, differences))
    return found


def table_files(root: Path) -> list[Path]:
    """Return the tidy CSV of every table of cells, sorted.

    Raises
    ------
    UserError
        If there is none.
    """
    found = sorted(path for path in (root / "tables").glob("*.csv") if path.stem != "runtime")
    if not found:
        raise UserError(f"{root / 'tables'} holds no tables; finish the run first")
    return found


def read_cells(path: Path) -> dict[tuple[str, ...], Cell]:
    """Read a table's cells by `CELL_KEY`, in their order.

    Raises
    ------
    UserError
        If a column is missing.
    """
    frame = read_csv(path)
    absent = [name for name in CELL_COLUMNS if name not in frame.columns]
    if absent:
        raise UserError(f"{path}: no column {absent[0]!r}; delete the file and make it again")
    frame = frame.astype(dict.fromkeys(CELL_COLUMNS[:4], str))
    cells = [{name: cell[name] for name in CELL_COLUMNS} for cell in frame.to_dict("records")]
    return {tuple(cell[name] for name in CELL_KEY): cell for cell in cells}


def read_verdicts(root: Path) -> dict[str, str]:
    """Read the verdict of each claim of a run or reference."""
    path = root / "claims.csv"
    claims = read_csv(path)
    need_columns(path, claims, ("id", "verdict"))
    need_verdicts(path, claims["verdict"])
    claims = claims.drop_duplicates("id")
    return dict(zip(claims["id"], claims["verdict"], strict=True))


def differing_settings(
    reference: Mapping[str, Any], run: Mapping[str, Any]
) -> tuple[SettingDifference, ...]:
    """Return the settings on which results depend and that differ, in the reference's order."""
    differences = _differences(_telling(reference), _telling(run))
    return tuple(d for d in differences if d[0] not in _SURROUNDINGS)


def _telling(configuration: Mapping[str, Any]) -> dict[str, Any]:
    """Leave out what no table that every run has depends on."""
    kept = {key: value for key, value in configuration.items() if key not in _OF_EXTENSIONS}
    if kept.get("recommendation") == _FREE_TRAVEL:
        del kept["recommendation"]
    if kept.get("sensor", {}).get("name") == IDEAL:
        kept["sensor"] = {"name": IDEAL}
    return kept


def differing_surroundings(
    reference: Path, run: Path, known: Mapping[str, Any], ours: Mapping[str, Any]
) -> list[str]:
    """Return a line on paths, hardware, commit and versions, where they differ."""
    settings = [d for d in _differences(known, ours) if d[0] in _SURROUNDINGS]
    made = list(_differences(read_provenance(reference), read_provenance(run)))
    texts = [setting_text((key.removeprefix("packages."), *rest)) for key, *rest in settings + made]
    return [f"made with: {', '.join(texts)}"] if texts else []


def other_settings(reference: Path, differences: Iterable[SettingDifference]) -> str:
    """Return the line that says why a run cannot be expected to agree with a reference."""
    texts = ", ".join(setting_text(difference) for difference in differences)
    return f"other settings than {reference}, so that no agreement is to be expected: {texts}"


def setting_text(difference: SettingDifference) -> str:
    """Return a difference as ``key=run's value (reference: value)``."""
    key, theirs, mine = difference
    return f"{key}={mine} (reference: {theirs})"


def _differences(
    theirs: Mapping[str, Any], mine: Mapping[str, Any], prefix: str = ""
) -> Iterator[SettingDifference]:
    for key in dict.fromkeys([*theirs, *mine]):
        # A key that is younger than one of the two has its default there.
        otherwise = default_of(f"{prefix}{key}", UNSET)
        a, b = theirs.get(key, otherwise), mine.get(key, otherwise)
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            yield from _differences(a, b, f"{prefix}{key}.")
        elif a != b:
            yield f"{prefix}{key}", a, b
