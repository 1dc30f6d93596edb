"""A copy of the project, small runs of its real Snakefile, and ways to look at them."""

import fcntl
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PARTS = ("Snakefile", "config", "workflow", "studies", "profiles", "src")
STUDIES = ("--snakefile", "studies/Snakefile")
TINY = (
    "categories=[mug,chair]",
    "elevations_deg.mug=[0]",
    "n_objects=8",
    "calibration_fraction=0.5",
    "n_resamples=100",
    "camera.image_side=16",
    "estimator.channels=[4,8]",
    "estimator.epochs=1",
    "estimator.warm_start=none",
    "density.bandwidths_deg=[8,20]",
    "density.pseudo_observations=[10]",
    "density.n_parts=2",
    "name=tiny",
)
MUGS = tuple("categories=[mug]" if item.startswith("categories=") else item for item in TINY)


@dataclass(frozen=True)
class Project:
    """A working copy in which the workflow can be run."""

    folder: Path

    @property
    def results(self) -> Path:
        return self.folder / "results" / "tiny"

    def command(self, *arguments: str, overrides: tuple[str, ...] = TINY) -> list[str]:
        joined = ",".join(overrides)
        base = [sys.executable, "-m", "snakemake", *arguments]
        return [*base, "--config", "experiment=small", f"overrides=[{joined}]"]

    @property
    def environment(self) -> dict[str, str]:
        own = os.environ | {"PYTHONPATH": str(self.folder / "src")}
        own.pop("SNAKEMAKE_PROFILE", None)
        return own

    def run(
        self, *arguments: str, overrides: tuple[str, ...] = TINY, fails: bool = False
    ) -> subprocess.CompletedProcess[str]:
        done = subprocess.run(
            self.command(*arguments, overrides=overrides),
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=600,
        )
        assert (done.returncode != 0) == fails, done.stdout + done.stderr
        return done

    def would_run(self, *more: str, targets: tuple[str, ...] = ()) -> dict[str, int]:
        """Return how many jobs of which rule a run with more overrides would start.

        `targets` may begin with `STUDIES`. Without the project's profile, which prints no table of
        jobs, and with its triggers.
        """
        triggers = ("--rerun-triggers", "input", "mtime", "params", "software-env")
        asked = ("--cores", "2", "--dry-run", "--workflow-profile", "none", *targets)
        done = self.run(*triggers, *asked, overrides=(*TINY, *more))
        stats = re.search(r"^job +count\n[- ]+\n(.*?)\n\n", done.stdout, re.M | re.S)
        if stats is None:
            assert "Nothing to be done" in done.stdout + done.stderr
            return {}
        counts = dict(line.split() for line in stats.group(1).splitlines())
        return {name: int(n) for name, n in counts.items() if name not in ("all", "total")}

    def outcome(self) -> dict[str, bytes]:
        """Return the bytes of everything that has to be reproducible."""
        kinds = ("evaluation/**/*.csv", "estimates/**/*.csv", "splits/*.csv", "tables/*")
        kinds += ("lookup/**/*.npz", "depth/**/*.npy", "estimators/**/*.safetensors")
        kinds += ("claims.*", "figures/*", "meshes/*.npz")
        found = (path for kind in kinds for path in self.results.glob(kind))
        paths = sorted(
            path for path in found if path.stem != "runtime" and path.suffix != ".damaged"
        )
        return {str(path.relative_to(self.results)): path.read_bytes() for path in paths}


def copy_of_project(folder: Path) -> Project:
    for part in PARTS:
        source = ROOT / part
        if source.is_dir():
            ignored = shutil.ignore_patterns("__pycache__", "*.egg-info")
            shutil.copytree(source, folder / part, symlinks=True, ignore=ignored)
        else:
            shutil.copy2(source, folder / part)
    return Project(folder)


def copy_run(project: Project, folder: Path) -> None:
    """Copy what a run has made into another copy of the project."""
    for part in ("results", ".snakemake"):
        shutil.copytree(project.folder / part, folder / part, symlinks=True)


def finished_project(
    factory: pytest.TempPathFactory,
    name: str,
    *targets: str,
    overrides: tuple[str, ...] = TINY,
    prepare: Callable[[Path], object] | None = None,
) -> Project:
    """Return an own copy of a project after a run on two cores.

    One of the processes that share the tests runs it. The others wait: it takes both cores.
    `prepare` gets the project's folder before the run.
    """

    def run(folder: Path) -> None:
        project = copy_of_project(folder)
        if prepare is not None:
            prepare(folder)
        project.run("--cores", "2", *targets, overrides=overrides)

    own = factory.mktemp(name)
    if "PYTEST_XDIST_WORKER" not in os.environ:
        run(own)
        return Project(own)
    # The folders of all processes are in one, which is of this run of the tests alone.
    of_all = factory.getbasetemp().parent
    with (of_all / f"{name}.lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        if not (of_all / name).exists():
            partial = of_all / f"{name}.partial"
            # What is left where another process failed to make it.
            shutil.rmtree(partial, ignore_errors=True)
            partial.mkdir()
            run(partial)
            partial.rename(of_all / name)
    shutil.copytree(of_all / name, own, symlinks=True, dirs_exist_ok=True)
    return Project(own)
