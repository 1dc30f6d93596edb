"""Where every file of a results folder lies: rules and scripts take paths from here alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any


@dataclass(frozen=True)
class Layout:
    """The paths below `root`, a results folder such as ``results/<name>``.

    A method takes values (``elevation=15``, ``fold=2``) or Snakemake's wildcards
    (``elevation="{elevation}"``), and returns a path as text.
    """

    root: str

    def below(self, *folders: str) -> Layout:
        """Return the same paths below a subfolder, such as those of one condition of transfer."""
        return Layout("/".join((self.root, *folders)))

    def shuffle(self, shuffle: int | str) -> Layout:
        """Return where one division into folds lies; 0 is the run's own."""
        return self if str(shuffle) == "0" else self.below("confirmation", f"shuffle{shuffle}")

    def replicate(self, shuffle: int | str, replicate: int | str) -> Layout:
        """Return where one training under a shuffle lies; 0 and 0 are the run's own."""
        if (str(shuffle), str(replicate)) == ("0", "0"):
            return self
        return self.below("confirmation", f"shuffle{shuffle}", f"replicate{replicate}")

    def kept_estimates(self, shuffle: int | str, replicate: int | str) -> str:
        """Return the held-out estimates of one training of every fold, in one file."""
        return f"{self.root}/confirmation/kept/shuffle{shuffle}_replicate{replicate}.npz"

    @property
    def all_kept_estimates(self) -> str:
        """The held-out estimates of all trainings: what the statistics are redone from."""
        return f"{self.root}/confirmation/estimates.npz"

    def factorial(
        self,
        name: str,
        run: str,
        shuffle: int | str,
        replicate: int | str,
        category: str,
        elevation: int | str,
    ) -> str:
        """Return what became of every choice and fusion after one training.

        `name`: ``objects`` (each object's errors), ``beliefs`` (how well the beliefs after several
        views know each object's pose) or ``densities`` (those chosen).
        """
        place = f"{run}/shuffle{shuffle}_replicate{replicate}"
        unit = unit_folder(category, elevation)
        return f"{self.root}/confirmation/{name}/{place}/{unit}.csv"

    def confirmation(self, name: str, kind: str) -> str:
        """Return a table or figure over all trainings."""
        return f"{self.root}/confirmation/{name}.{kind}"

    def meshes(self, category: str) -> str:
        """Return the prepared meshes of a category."""
        return f"{self.root}/meshes/{category}.npz"

    def splits(self, category: str) -> str:
        """Return the role of each object in each fold."""
        return f"{self.root}/splits/{category}.csv"

    def depth(self, category: str, elevation: int | str) -> str:
        """Return the depth images of a unit."""
        return f"{self.root}/depth/{unit_folder(category, elevation)}.npy"

    def depth_objects(self, category: str, elevation: int | str) -> str:
        """Return the ids of the objects in a unit's depth images, in their order."""
        return f"{self.root}/depth/{unit_folder(category, elevation)}_objects.json"

    def estimator(self, category: str, elevation: int | str, fold: int | str) -> str:
        """Return the estimator that a fold tests."""
        return self._of_fold("estimators", category, elevation, fold, "estimator.safetensors")

    def pretrained(self, fold: int | str, part: int | str | None = None) -> str:
        """Return the network of all categories that a fold's estimators can start from."""
        name = "estimator" if part is None else f"without_part{part}"
        return f"{self.root}/estimators/pretrained/fold{fold}/{name}.safetensors"

    def part_estimator(
        self, category: str, elevation: int | str, fold: int | str, part: int | str
    ) -> str:
        """Return the cross-fitted estimator that has not seen one part of the training objects."""
        return self._of_fold(
            "estimators", category, elevation, fold, f"without_part{part}.safetensors"
        )

    def estimates(self, category: str, elevation: int | str, fold: int | str, role: str) -> str:
        """Return the estimates of a fold's ``calibration`` or ``test`` objects."""
        return self._of_fold("estimates", category, elevation, fold, f"{role}.csv")

    def posteriors(self, category: str, elevation: int | str, fold: int | str, role: str) -> str:
        """Return the distributions that a classifier gives for the same images."""
        return self._of_fold("estimates", category, elevation, fold, f"{role}_posteriors.npz")

    def lookup(self, category: str, elevation: int | str, fold: int | str, name: str) -> str:
        """Return a lookup table: of a criterion, or of an extension by its name."""
        return self._of_fold("lookup", category, elevation, fold, f"{name}.npz")

    def evaluation(self, category: str, elevation: int | str, fold: int | str, method: str) -> str:
        """Return what one method made of every view of a fold's test objects."""
        return self._of_fold("evaluation", category, elevation, fold, f"{method}.csv")

    def extension(self, category: str, elevation: int | str, fold: int | str, name: str) -> str:
        """Return one of a fold's files on extensions: ``choices``, ``objects``, ``travel``, …."""
        return self._of_fold("extensions", category, elevation, fold, f"{name}.csv")

    def ablation(self, setting: str) -> str:
        """Return the errors under one setting of the ablation."""
        return f"{self.root}/ablation/{setting}.csv"

    def table(self, name: str, kind: str) -> str:
        """Return a table as ``csv``, ``md``, ``tex`` or ``html``."""
        return f"{self.root}/tables/{name}.{kind}"

    def figure(self, name: str, kind: str) -> str:
        """Return a figure as ``png``, ``pdf`` or ``svg``, or an animation as ``gif``."""
        return f"{self.root}/figures/{name}.{kind}"

    def claims(self, kind: str) -> str:
        """Return the paper's claims and their verdicts as ``csv`` or ``md``."""
        return f"{self.root}/claims.{kind}"

    def bundle(self, category: str, kind: str, variant: str = "") -> str:
        """Return a category's bundle (``safetensors``), or its errors on test objects (``csv``).

        ``variant`` is what `bundle_variant` returns.
        """
        return f"{self.root}/bundles{variant}/{category}.{kind}"

    def bundle_depth(self, category: str, elevation: int | str, variant: str = "") -> str:
        """Return the randomised depth images that a bundle learns from."""
        return f"{self.root}/bundles{variant}/depth/{unit_folder(category, elevation)}.npy"

    def bundle_objects(self, category: str, elevation: int | str, variant: str = "") -> str:
        """Return the ids of the objects in `bundle_depth`, in their order."""
        return f"{self.root}/bundles{variant}/depth/{unit_folder(category, elevation)}_objects.json"

    def bundle_estimator(self, category: str, variant: str = "") -> str:
        """Return the network of a bundle, trained over all elevations."""
        return f"{self.root}/bundles{variant}/estimators/{category}.safetensors"

    def log(self, job: str) -> str:
        """Return a job's log."""
        return f"{self.root}/logs/{job}.log"

    def benchmark(self, job: str) -> str:
        """Return what Snakemake measured of a job."""
        return f"{self.root}/benchmarks/{job}.tsv"

    @property
    def checksums(self) -> str:
        """The folder of `checksum_of` every file."""
        return f"{self.root}/checksums"

    @property
    def logs(self) -> str:
        """The folder of all logs."""
        return f"{self.root}/logs"

    @property
    def configuration(self) -> str:
        """The resolved configuration."""
        return f"{self.root}/configuration.yaml"

    @property
    def provenance(self) -> str:
        """Commit and versions."""
        return f"{self.root}/provenance.json"

    @property
    def report(self) -> str:
        """The page that shows everything."""
        return f"{self.root}/report.html"

    @property
    def explorer(self) -> str:
        """The page to play with."""
        return f"{self.root}/explorer.html"

    def _of_fold(
        self, stage: str, category: str, elevation: int | str, fold: int | str, name: str
    ) -> str:
        return f"{self.root}/{stage}/{fold_folder(category, elevation, fold)}/{name}"


def checksum_of(path: str) -> str | None:
    """Return where the checksum of a run's file lies; None for a file that is of no run."""
    results, *inside = PurePath(path).parts
    if results != "results" or len(inside) < 2:
        return None
    run, *rest = inside
    return f"{Layout(f'results/{run}').checksums}/{'/'.join(rest)}.sha256"


def unit_folder(category: str, elevation: int | str) -> str:
    """Return ``<category>/el<EE>``."""
    degrees = elevation if isinstance(elevation, str) else f"{elevation:02d}"
    return f"{category}/el{degrees}"


def fold_folder(category: str, elevation: int | str, fold: int | str) -> str:
    """Return ``<category>/el<EE>/fold<k>``."""
    return f"{unit_folder(category, elevation)}/fold{fold}"


def bundle_variant(without: str = "", replicate: int = 0) -> str:
    """Return the folder below ``bundles`` of a training without an ingredient, or of a replicate.

    Replicate 0 with all ingredients is the bundle itself, whose folder is ``bundles``.
    """
    named = f"/without_{without}" if without else ""
    return f"{named}/replicate{replicate}" if replicate else named


def files_by_run(
    keys: Sequence[tuple[Any, ...]], paths: Iterable[str]
) -> dict[str, dict[tuple[Any, ...], str]]:
    """Return the files of each run by the rest of their key.

    A key is a run's name and what the file is about: category, elevation, fold, ….
    """
    files: dict[str, dict[tuple[Any, ...], str]] = {}
    for (run, *rest), path in zip(keys, paths, strict=True):
        files.setdefault(run, {})[tuple(rest)] = path
    return files
