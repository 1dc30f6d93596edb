"""The files of the studies, from the plan of the run and the files of other runs."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nbv.core.circle.criteria import CRITERIA
from nbv.data.sensors import check_sensor
from nbv.errors import UserError
from nbv.experiment.config import load_config, read_configuration
from nbv.experiment.plan import Fold, Plan
from nbv.experiment.results import ESTIMATED_ROLES, Unit
from studies.kept_estimates import kept_settings
from studies.solids import SOLIDS

Training = tuple[int, int]
"""A shuffle of the objects into folds, and a replicate of its trainings."""


@dataclass(frozen=True)
class KeptRun:
    """A run whose estimates enter the statistics.

    Attributes
    ----------
    path : str or None
        The file of kept estimates; None for this run's estimates.
    keys : sequence of (shuffle, replicate, category, elevation in degrees)
    dataset : str
        The name of its data set.
    """

    path: str | None
    keys: Sequence[tuple[int, int, str, int]]
    dataset: str


@dataclass(frozen=True, eq=False)
class Studies:
    """The files that the studies of one run make.

    Folders are relative to the run's folder: empty, or with a leading slash.
    """

    run: Plan

    # Extensions

    @property
    def decision(self) -> dict[str, Any]:
        """Settings that decide on a rotation where distributions are fused."""
        return self.run.decision | {"affinity": self.run.config["affinity"]}

    @property
    def extension_lookups(self) -> list[str]:
        """The extensions that have a lookup table."""
        return [
            name
            for name, method in self.run.config["extensions"].items()
            if method["policy"] in CRITERIA and method["fusion"] != "product"
        ]

    def check_posterior(self, *policies: str) -> None:
        """Raise UserError where no extension with the fusion posterior has one of the policies."""
        methods = self.run.config["extensions"].values()
        known = {method["policy"] for method in methods if method["fusion"] == "posterior"}
        for policy in policies:
            if policy not in known:
                raise UserError(
                    f"extensions: this target needs {{policy: {policy}, fusion: posterior}}"
                )

    # Other runs

    def settings_of(self, run: str) -> Mapping[str, Any]:
        """Return the configuration of a finished run."""
        return self.run.config if run == self.run.config["name"] else _settings_of(run)

    def check_file(self, run: str, path: str, key: str) -> None:
        """Raise UserError where a file of another run is missing; `key` names that run."""
        if run != self.run.config["name"] and not Path(path).exists():
            raise UserError(f"{key}: {path} does not exist; finish the run {run} first")

    @property
    def leaderboard_folds(self) -> list[tuple[str, str, int, int]]:
        """Run, category, elevation and fold of everything that the leaderboard ranks."""
        runs = self.run.config["leaderboard_runs"] or [self.run.config["name"]]
        settings = {run: self.settings_of(run) for run in runs}
        return [
            (run, category, elevation, fold)
            for run in runs
            for category in settings[run]["categories"]
            for elevation in settings[run]["elevations_deg"][category]
            for fold in range(1, settings[run]["n_folds"] + 1)
        ]

    @property
    def compared_runs(self) -> list[str]:
        """The run's name, then those that it is compared with."""
        return list(dict.fromkeys([self.run.config["name"], *self.run.config["compared_runs"]]))

    def two_view_methods(self, run: str) -> list[str]:
        """Return a run's methods of two views, and those that multiply its distributions."""
        settings = self.settings_of(run)
        methods, extensions = settings["methods"], settings["extensions"].items()
        return [
            *(name for name, method in methods.items() if method["policy"] != "none"),
            *(name for name, method in extensions if method.get("fusion") == "product"),
        ]

    def compared_roles(self, run: str) -> Sequence[str]:
        """Return the roles to compare: the calibration objects where all runs have the same."""
        runs = self.compared_runs
        ways = {self.settings_of(name).get("calibration", "holdout") for name in runs}
        return ESTIMATED_ROLES if len(ways) == 1 else ("test",)

    def compared(
        self, names_of: Callable[[str], Iterable[str]]
    ) -> list[tuple[str, str, int, int, str]]:
        """Return run, category, elevation, fold, and each name that `names_of` gives the run."""
        return [
            (run, *fold, name)
            for run in self.compared_runs
            for fold in self.run.folds_of(self.run.units)
            for name in names_of(run)
        ]

    # Three dimensions

    @property
    def rotation_files(self) -> dict[str, str]:
        """The pairs and BOP's ``models_info`` of the study `rotations`, where they are given."""
        files = {key: self.run.config["rotations"][key] for key in ("pairs", "models_info")}
        for key, path in files.items():
            if path is None or not Path(path).exists():
                raise UserError(f"rotations.{key}={path or 'null'}: this target needs a file there")
        return files

    @property
    def category_folds(self) -> list[tuple[str, int]]:
        """Category and fold of each estimator of rotations.

        Raises
        ------
        UserError
            Where the run trains no network that has calibration objects.
        """
        if self.run.external or self.run.linear or self.run.crossfit:
            raise UserError(
                "rotations.pairs=null: the study trains its own networks; give estimator=regressor "
                "and calibration=holdout, or a table of pairs"
            )
        categories = self.run.config["categories"]
        return [(category, fold) for category in categories for fold in self.run.folds]

    @property
    def judged_folds(self) -> list[tuple[str, int]]:
        """Those of `category_folds` that the study `rotations` judges."""
        judged = self.run.config["rotations"]["judged_folds"] or self.run.folds
        return [(category, fold) for category, fold in self.category_folds if fold in judged]

    @property
    def shape_folds(self) -> list[tuple[str, int]]:
        """`category_folds`, and one fold of each solid, whose objects are all the same."""
        return self.category_folds + [(name, 1) for name in SOLIDS]

    # Trained on × tested on

    @property
    def transfer_unit(self) -> Unit:
        """The category and elevation of the transfer."""
        transfer = self.run.config["transfer"]
        return transfer["category"] or self.run.focus, transfer["elevation_deg"]

    @property
    def transfer_folds(self) -> list[int]:
        """The folds of the transfer."""
        return self.run.config["transfer"]["folds"] or list(self.run.folds)

    def condition(self, name: str) -> Mapping[str, Any]:
        """Return the run's configuration under a condition of the transfer."""
        settings = _under_condition(self.run, name)
        check_sensor(settings["sensor"], [self.transfer_unit[0]])
        return settings

    def condition_folder(self, name: str) -> str:
        """Return the folder of a condition: the run's where its settings are the same."""
        settings, config = self.condition(name), self.run.config
        is_run = self.transfer_unit in self.run.units and all(
            settings[key] == config[key] for key in ("camera", "sensor")
        )
        return "" if is_run else f"/transfer/{name}"

    def estimator_folder(self, name: str) -> str:
        """Return the folder of a condition's estimators.

        The run's estimators serve only where they too were trained from random weights.
        """
        if self.run.crossfit:
            raise UserError("transfer calibrates with objects held out: needs calibration=holdout")
        is_from_scratch = self.run.start(*self.transfer_unit) is None
        return self.condition_folder(name) if is_from_scratch else f"/transfer/{name}"

    # Trainings beyond the run's own

    @property
    def trainings(self) -> list[Training]:
        """Shuffle and replicate of every training."""
        replicates = self.run.config["confirmation"]["replicates"]
        return [(shuffle, n) for shuffle, of_it in enumerate(replicates) for n in of_it]

    @property
    def held_out(self) -> list[tuple[str, int, int, str]]:
        """Category, elevation, fold and role of the estimates that are kept of a training."""
        folds: list[Fold] = self.run.folds_of(self.run.lowest_units)
        return [(*fold, role) for fold in folds for role in ESTIMATED_ROLES]

    @functools.cached_property
    def kept_runs(self) -> dict[str, KeptRun]:
        """Estimates that enter the statistics, by run.

        Raises
        ------
        UserError
            Where two files are of one run, or of the same categories of one data set.
        """
        config = self.run.config
        if not config["confirmation"]["kept"]:
            units = self.run.lowest_units
            keys = [(*training, *unit) for training in self.trainings for unit in units]
            return {config["name"]: KeptRun(None, keys, _dataset(config))}
        runs: dict[str, KeptRun] = {}
        for path in config["confirmation"]["kept"]:
            settings, keys = _kept_settings(path)
            run, dataset = settings["name"], _dataset(settings)
            if run in runs:
                other = runs[run].path
                raise UserError(f"confirmation.kept: {path} is of the run {run}, as {other} is")
            categories = {key[2] for key in keys}
            for kept in runs.values():
                if kept.dataset == dataset and categories & {key[2] for key in kept.keys}:
                    raise UserError(
                        f"confirmation.kept: {path} and {kept.path} have the same categories of "
                        f"the data set {dataset}"
                    )
            runs[run] = KeptRun(path, keys, dataset)
        return runs

    @property
    def kept_trainings(self) -> list[dict[str, Any]]:
        """Data set, shuffle, replicate and category of each of the runs' keys, in their order."""
        return [
            {"dataset": run.dataset, "shuffle": key[0], "replicate": key[1], "category": key[2]}
            for run in self.kept_runs.values()
            for key in run.keys
        ]

    # Bundles without an ingredient of the randomisation

    @property
    def variants(self) -> dict[str, tuple[str, int]]:
        """Left-out ingredient and replicate by folder, without the bundle's training."""
        bundles = self.run.config["bundles"]
        all_variants = {
            variant_folder(without, replicate): (without, replicate)
            for without in ("", *bundles["ingredients"])
            for replicate in {0, *bundles["replicates"]}
        }
        return {folder: variant for folder, variant in all_variants.items() if folder}

    @property
    def rendered_variants(self) -> list[str]:
        """Folders of the variants that render images, which their replicates share."""
        return [folder for folder, (_, replicate) in self.variants.items() if not replicate]

    @property
    def compared_variants(self) -> list[tuple[str, str, int]]:
        """Category, left-out ingredient and replicate of each bundle in the table."""
        bundles = self.run.config["bundles"]
        return [
            (category, without, replicate)
            for category in self.run.config["categories"]
            for without in ("", *bundles["ingredients"])
            for replicate in bundles["replicates"]
        ]

    def randomisation(self, variant: str) -> dict[str, Any]:
        """Return the randomisation of a variant's images."""
        config, (without, _) = self.run.config, self.variants[variant]
        left_out = config["bundles"]["ingredients"].get(without, {})
        return {**config["randomisation"], **left_out}

    def bundle_settings(self, variant: str) -> dict[str, Any]:
        """Return the training settings that a variant's bundle records."""
        _, replicate = self.variants[variant]
        settings = self.run.bundle_settings | {"randomisation": self.randomisation(variant)}
        return settings | ({"replicate": replicate} if replicate else {})


def training_folder(shuffle: int | str, replicate: int | str) -> str:
    """Return the folder of a training, relative to the run's; empty for (0, 0), the run's."""
    is_run = (str(shuffle), str(replicate)) == ("0", "0")
    return "" if is_run else f"/confirmation/shuffle{shuffle}/replicate{replicate}"


def shuffle_folder(shuffle: int | str) -> str:
    """Return the folder of a shuffle, relative to the run's; empty for 0, the run's."""
    return "" if str(shuffle) == "0" else f"/confirmation/shuffle{shuffle}"


def variant_folder(without: str = "", replicate: int = 0) -> str:
    """Return the folder below ``bundles`` of a training without an ingredient, or of a replicate.

    Replicate 0 with all ingredients is the bundle itself, whose folder is ``bundles``.
    """
    named = f"/without_{without}" if without else ""
    return f"{named}/replicate{replicate}" if replicate else named


def files_of_manifest(path: str) -> list[str]:
    """Return a manifest, and the frames and masks that it names."""
    from nbv.bundles.recordings import read_manifest  # only here: it is slow

    try:
        recordings = read_manifest(path)
    except UserError as error:
        raise UserError(f"bundles.frames: {error}") from error
    columns = [each.frames.get(name, ()) for each in recordings for name in ("path", "mask")]
    return [path, *(file for column in columns for file in column if file)]


@functools.cache
def _settings_of(run: str) -> Mapping[str, Any]:
    needed = ("categories", "elevations_deg", "methods", "extensions")
    return read_configuration(Path("results") / run, needed)


@functools.cache
def _under_condition(run: Plan, name: str) -> Mapping[str, Any]:
    """Return a run's configuration with another sensor and framing.

    The run's overrides hold here too, except for the parameters of its sensor where the sensor
    differs.
    """
    conditions = run.config["transfer"]["conditions"]
    if name not in conditions:
        raise UserError(f"transfer.conditions has no {name}")
    sensor, framing = conditions[name]["sensor"], conditions[name]["framing"]
    replaced = r"sensor|camera\.framing"
    if sensor != run.config["sensor"]["name"]:
        replaced += r"|sensor\.parameters.*"
    kept = [
        override
        for override in run.overrides
        if not re.fullmatch(replaced, override.partition("=")[0].lstrip("+~"))
    ]
    return load_config(run.folder, [*kept, f"sensor={sensor}", f"camera.framing={framing}"])


def _kept_settings(path: str) -> tuple[dict[str, Any], list[tuple[int, int, str, int]]]:
    try:
        settings, keys = kept_settings(path)
    except UserError as error:
        raise UserError(f"confirmation.kept: {error}") from error
    return settings, list(dict.fromkeys(key[:4] for key in keys))


def _dataset(settings: Mapping[str, Any]) -> str:
    return str(settings["confirmation"]["dataset"] or settings["name"])
