"""What a run makes, from its configuration: units, folds, trainings, methods and their files."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nbv.core.circle.policies import needs_lookup
from nbv.data.meshes import load_meshes
from nbv.data.render import RENDERERS
from nbv.data.sensors import SENSORS, check_sensor
from nbv.data.sources import SOURCES, open_source, select_objects
from nbv.errors import UserError
from nbv.experiment.config import load_config
from nbv.experiment.config.schema import LINEAR
from nbv.experiment.methods import check_methods
from nbv.experiment.report import settings as report
from nbv.experiment.results import Unit
from nbv.experiment.run import provenance
from nbv.experiment.stages import FEATURES, Stage, Start, stage_settings, start_of
from nbv.tables.pairs import PairTable

Fold = tuple[str, int, int]
"""Category, elevation in degrees, and fold, from 1."""

FEWEST_OBJECTS = 50
"""Test objects of a category. With 125, the intervals of Table 1's differences reach 0.2 to 1.7
degrees to either side, less than most of those differences; with 50 they are 1.6 times as wide,
which is as large as the differences themselves."""

FEWEST_EPOCHS = 4
"""Epochs of training: the shortest schedule of ``config/estimator``."""

OF_ELEVATIONS = {"table2", "table4", "figure6"}
"""Tables and figures of the focus category at every elevation."""

OF_FOCUS = {
    *("table5", "table6", "table7"),
    *("steps", "figure2", "figure3", "figure7", "figure8", "heatmaps"),
}
"""Those of the focus category at the reference elevation. All others compare the categories."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What a run makes, from its configuration and the ids of each category's objects.

    The configuration was composed of the files in `folder`, with the overrides.
    """

    folder: Path
    overrides: tuple[str, ...]
    config: Mapping[str, Any]
    objects: Mapping[str, Sequence[str]]

    @staticmethod
    @functools.cache
    def load(folder: Path, overrides: tuple[str, ...]) -> Plan:
        """Compose and check the configuration, and choose the objects.

        Raises
        ------
        UserError
            In one line, for the first setting that is wrong.
        """
        config = load_config(folder, overrides)
        check_methods(config["methods"], config["extensions"], config["gives_distributions"])
        check_sensor(config["sensor"], config["categories"])
        return Plan(folder, overrides, config, _objects(config))

    @property
    def results(self) -> str:
        """The folder of the run's results."""
        return f"results/{self.config['name']}"

    @property
    def external(self) -> bool:
        """Whether the estimates come from a file of another program."""
        return "pairs" in self.config["estimator"]

    @property
    def linear(self) -> bool:
        """Whether the estimators are linear in depth features, and no network is trained."""
        return self.config["estimator"]["kind"] in LINEAR

    @property
    def crossfit(self) -> bool:
        """Whether calibration is cross-fitted."""
        return bool(self.config["calibration"] == "crossfit")

    @property
    def estimates_apart(self) -> bool:
        """Whether a job of its own estimates; otherwise the one that makes the estimator does."""
        return self.external or (self.crossfit and not self.linear)

    @property
    def folds(self) -> Sequence[int]:
        """The folds, from 1."""
        return range(1, self.config["n_folds"] + 1)

    @property
    def parts(self) -> Sequence[int]:
        """The parts of a fold's training objects, where calibration is cross-fitted."""
        return range(1, self.config["crossfit_parts"] + 1) if self.crossfit else ()

    @property
    def units(self) -> list[Unit]:
        """Every category at each of its elevations. Each fold of a unit has its own estimator."""
        elevations = self.config["elevations_deg"]
        return [
            (category, each)
            for category in self.config["categories"]
            for each in elevations[category]
        ]

    @property
    def lowest_units(self) -> list[Unit]:
        """Each category at its lowest elevation."""
        elevations = self.config["elevations_deg"]
        return [(category, min(elevations[category])) for category in self.config["categories"]]

    def folds_of(self, units: Iterable[Unit]) -> list[Fold]:
        """Return every fold of some units."""
        return [(*unit, fold) for unit in units for fold in self.folds]

    def evaluations_of(self, units: Iterable[Unit]) -> list[tuple[str, int, int, str]]:
        """Return category, elevation, fold and method of every evaluation in the paper's tables."""
        methods = self.config["methods"]
        return [(*unit, fold, name) for unit in units for name in methods for fold in self.folds]

    @property
    def lookup_criteria(self) -> list[str]:
        """The criteria of the lookup tables, sorted."""
        policies = {method["policy"] for method in self.config["methods"].values()}
        return sorted(filter(needs_lookup, policies))

    @property
    def lookups(self) -> list[tuple[str, int, int, str]]:
        """Category, elevation, fold and criterion of every lookup table."""
        folds = self.folds_of(self.units)
        return [(*fold, criterion) for fold in folds for criterion in self.lookup_criteria]

    @property
    def decision(self) -> dict[str, Any]:
        """What decides on a rotation: the conditionals, and the cost of travel."""
        return {**self.config["density"], **self.config["recommendation"]}

    @property
    def caution(self) -> tuple[str, ...]:
        """What has to be said wherever there are numbers; see `too_small`."""
        epochs = None if self.external else self.config["estimator"].get("epochs")
        what = (
            "differences between its methods"
            if self.config["experiment"] == "bundles"
            else "its numbers"
        )
        return too_small({name: len(ids) for name, ids in self.objects.items()}, epochs, what)

    # Trainings

    def start(self, category: str, elevation: int) -> Start:
        """Return what the trainings of a unit start from; see `start_of`."""
        if self.linear:
            return None
        elevations = self.config["elevations_deg"][category]
        return start_of(self.config["estimator"]["warm_start"], elevations, elevation)

    def stage(self, stage: Stage) -> dict[str, Any]:
        """Return the settings of a stage. Cross-fitting trains each estimator in fewer epochs.

        Raise UserError where the estimator is not trained.
        """
        if self.linear:
            kind = self.config["estimator"]["kind"]
            raise UserError(
                f"estimator={kind} trains no network, which this target needs; give "
                "estimator=regressor or classifier"
            )
        epochs = self.config["crossfit_epochs"] if self.crossfit else None
        return stage_settings(self.config["estimator"], stage, epochs)

    @property
    def bundle_stage(self) -> Stage:
        """The stage of a bundle's training: from random weights, or from the depth features."""
        return (
            "fine_tuning" if self.config["estimator"].get("warm_start") == FEATURES else "training"
        )

    def mirror_plane_deg(self, category: str) -> float | None:
        """Return the plane of symmetry whose mirror images a category's estimators learn from."""
        if not self.config["estimator"]["mirror_images"]:
            return None
        plane: float | None = self.config["mirror_plane_deg"].get(category)
        return plane

    @property
    def unmirrored(self) -> tuple[str, ...]:
        """Which categories lack the mirror images that networks are to learn from."""
        if self.external or self.linear or not self.config["estimator"]["mirror_images"]:
            return ()
        without = [
            name for name in self.config["categories"] if self.mirror_plane_deg(name) is None
        ]
        if not without:
            return ()
        return (
            f"{' and '.join(without)}: no mirror_plane_deg, so no mirror images; give the azimuth "
            "of the plane of symmetry, or about twice the epochs",
        )

    def dataset_of(self, category: str) -> dict[str, Any]:
        """Return the data set's settings that concern one category.

        Exclusions are omitted because `objects` already reflects them.
        """
        settings = dict(self.config["dataset"])
        for key in ("categories", "turn_deg"):
            settings[key] = {k: v for k, v in settings[key].items() if k == category}
        if category != "mug":
            settings["handle_reach"] = settings["square_share"] = 0.0
        return settings | {"exclude": [], "exclude_file": None}

    @property
    def bundle_settings(self) -> dict[str, Any]:
        """What a bundle says of its training."""
        return {key: self.config[key] for key in ("dataset", "sensor", "seed", "randomisation")}

    # Checks of what a target needs

    def check_images(self) -> None:
        """Raise UserError where the estimator is external."""
        if self.external:
            kind = self.config["estimator"]["kind"]
            raise UserError(
                f"estimator={kind} has no meshes, images or trainings, which this target needs; "
                "the report (no target) needs none"
            )

    def check_bundle(self, category: str) -> None:
        """Raise UserError where the settings make no bundle of a category."""
        self.check_images()
        framing, calibration = self.config["camera"]["framing"], self.config["calibration"]
        if framing != "silhouette":
            raise UserError(
                f"camera.framing={framing}: a bundle's frames are centred on what is visible; "
                "give silhouette"
            )
        if calibration != "holdout":
            raise UserError(f"calibration={calibration}: a bundle needs calibration=holdout")
        if (kind := self.config["estimator"]["kind"]) != "classifier":
            raise UserError(f"estimator={kind}: a bundle needs estimator=classifier")
        if category not in self.config["sensor"]["diagonal_m"]:
            raise UserError(
                f"sensor.diagonal_m.{category}: a bundle needs the object's diagonal, metres"
            )

    # What is shown

    @property
    def focus(self) -> str:
        """The category that the detailed tables and figures are about."""
        return report.focus_category(self.units, self.config["focus_category"])

    @property
    def focus_unit(self) -> Unit:
        """The focus category at the reference elevation."""
        return report.focus_unit(self.units, self.config["focus_category"])

    @property
    def reference_units(self) -> list[Unit]:
        """The units that categories are compared by."""
        return report.reference_units(self.units)

    def units_of(self, name: str) -> list[Unit]:
        """Return the units that a table or figure is about."""
        if name in OF_ELEVATIONS:
            return [unit for unit in self.units if unit[0] == self.focus]
        return [self.focus_unit] if name in OF_FOCUS else self.reference_units

    @property
    def resampled(self) -> dict[str, Any]:
        """The report settings of tables that have intervals."""
        resamples = {key: self.config[key] for key in ("n_resamples", "seed")}
        return {"methods": list(self.config["methods"])} | resamples

    def settings_of(self, name: str) -> dict[str, Any]:
        """Return the report settings that a table or figure depends on."""
        # Figures have no intervals.
        keys = ("methods", "n_resamples", "seed") if name.startswith("table") else ("methods",)
        shown = {key: self.resampled[key] for key in keys}
        of_focus = name in OF_ELEVATIONS | OF_FOCUS
        return shown | ({"focus_category": self.focus} if of_focus else {})

    def jobs(self, tables: Iterable[str], figures: Iterable[str]) -> list[tuple[str, str]]:
        """Return rule and log of every job that the running time counts, sorted by log.

        A log is named as below the folder of logs, without suffix.
        """
        units, categories = ([], []) if self.external else (self.units, self.config["categories"])
        folds, trained = self.folds_of(self.units), self.folds_of(units)
        pretrains = self.config["estimator"].get("warm_start") in ("categories", "both")
        pretrained = self.folds if pretrains else ()
        parts = () if self.linear else self.parts
        estimated = folds if self.estimates_apart else []
        fold = "{category}/el{elevation}/fold{fold}"
        logs = {
            "meshes": paths("{category}", zip(categories)),
            "splits": paths("{category}", zip(self.config["categories"])),
            "render": paths("{category}/el{elevation}", units),
            "pretrain": paths("fold{fold}", zip(pretrained)),
            "pretrain_part": [f"fold{k}/{part}" for k in pretrained for part in parts],
            "extract": paths("{category}/el{elevation}", units if self.linear else ()),
            "train": [] if self.linear else paths(fold, trained),
            "fit": paths("{category}/el{elevation}", units if self.linear else ()),
            "train_part": [f"{path}/{k}" for path in paths(fold, folds) for k in parts],
            "estimate": paths(fold, estimated),
            "lookup": paths(f"{fold}/{{criterion}}", self.lookups),
            "evaluate": paths(fold, folds),
            "table": tables,
            "figure": figures,
        }
        jobs = [(rule, f"{rule}/{log}") for rule, names in logs.items() for log in names]
        jobs += [("claims", "claims"), ("settings", "settings")]
        return sorted(jobs, key=lambda job: Path(job[1]).parts)

    def sources(self, script: Path, settings: Mapping[str, Any] | None = None) -> list[str]:
        """Return a script and what it depends on in nbv, relative to the working directory.

        `settings` is a configuration with another sensor.
        """
        settings = settings or self.config
        sensor = SENSORS.get(settings["sensor"]["name"])
        drawn_by = (RENDERERS[settings["renderer"]["name"]], *([sensor] if sensor else []))
        chosen = {
            "prepare_meshes": (SOURCES[settings["dataset"]["source"]],),
            "render_depth": drawn_by,
            "render_bundle": drawn_by,
        }
        here = Path.cwd()
        return [
            str(Path(file).relative_to(here)) if Path(file).is_relative_to(here) else file
            for file in (str(script), *provenance.source_files(script, chosen.get(script.stem, ())))
        ]


def _objects(config: Mapping[str, Any]) -> dict[str, Sequence[str]]:
    """Return the objects of each category; those of the last run where the data set is gone."""
    categories, elevations = config["categories"], config["elevations_deg"]
    if "pairs" in config["estimator"]:
        pairs = PairTable.load(config["estimator"]["pairs"])
        pairs.check_classes(config["estimator"].get("n_classes"))
        return dict(pairs.objects({name: elevations[name] for name in categories}))
    root = config["dataset"]["root"]
    gone = root and not Path(root).expanduser().exists()
    objects: dict[str, Sequence[str]] = {}
    for category in categories:
        prepared = Path("results", config["name"], "meshes", f"{category}.npz")
        if gone and prepared.exists():
            objects[category] = list(load_meshes(prepared))
            continue
        try:
            source = open_source(config["dataset"], config["seed"])
            objects[category] = select_objects(source, category, config["n_objects"])
        except OSError as error:
            where = f"{error.filename} cannot be read: {error.strerror}"
            raise UserError(f"dataset.root: {where}") from error
    return objects


def paths(pattern: str, keys: Iterable[Sequence[Any]]) -> list[str]:
    """Return a path for each key; its values stand in the order of the pattern's wildcards.

    >>> paths("depth/{category}/el{elevation}.npy", [("mug", 0), ("car", 15)])
    ['depth/mug/el00.npy', 'depth/car/el15.npy']
    """
    names, filled = re.findall(r"\{(\w+)\}", pattern), []
    for key in keys:
        values = dict(zip(names, key, strict=True))
        if "elevation" in values:
            values["elevation"] = f"{int(values['elevation']):02d}"
        filled.append(pattern.format(**values))
    return filled


def too_small(
    n_objects: Mapping[str, int], epochs: int | None, what: str = "its numbers"
) -> tuple[str, ...]:
    """Return a sentence that says why a run is too small; none where it is large enough.

    `n_objects` is by category; `epochs` is None for estimates of another program.
    """
    reasons = []
    few = {category: n for category, n in n_objects.items() if n < FEWEST_OBJECTS}
    if few:
        fewest = min(few, key=few.__getitem__)
        reasons.append(f"{few[fewest]} objects of {fewest}, and {FEWEST_OBJECTS} are the least")
    if epochs is not None and epochs < FEWEST_EPOCHS:
        s = "s" if epochs > 1 else ""
        reasons.append(f"{epochs} epoch{s} of training, and {FEWEST_EPOCHS} are the least")
    if not reasons:
        return ()
    return (f"This run is too small for {what} to mean anything: {'; '.join(reasons)}.",)
