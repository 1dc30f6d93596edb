"""A bundle: a trained network with what its errors on held-out objects taught, in one file.

The file is of the safetensors format: arrays, and metadata as JSON. It holds no code. The network
is an ONNX model. Calibration distributions are kept as logs, one byte each, see `PROBABILITY_STEP`.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import safetensors.numpy
from numpy.typing import ArrayLike, NDArray

from nbv.core.angles import nearest_bin
from nbv.data.camera import Camera
from nbv.errors import BundleError
from nbv.files import missing, replacing
from nbv.robot.ood import Familiarity

FORMAT = 4
"""Raised when the file changes; a program reads its own format alone."""

PROBABILITY_STEP = 0.054
"""Between kept logs of probabilities, in nats: 256 of them reach down to 1e-6."""


@dataclass(frozen=True)
class PaperTables:
    """What the paper's lookup tables recommend, one for each elevation.

    Attributes
    ----------
    elevation_deg : ndarray (E,) float32
    rotation_deg : ndarray (E, 360) int16
        The rotation of least pose ambiguity for each estimate, degrees in [0, 360).
    """

    elevation_deg: NDArray[np.float32]
    rotation_deg: NDArray[np.int16]

    def table_of(self, elevation_deg: float) -> int:
        """Return which table is nearest to an elevation: the lowest where it is not known (NaN)."""
        return int(np.nan_to_num(np.abs(self.elevation_deg - elevation_deg)).argmin())

    def recommend(self, estimate_deg: ArrayLike, elevation_deg: float) -> NDArray[np.float64]:
        """Return the rotations for estimates, of the table of `table_of` an elevation."""
        table = self.rotation_deg[self.table_of(elevation_deg)]
        rotations = table[nearest_bin(estimate_deg, len(table))]
        return np.asarray(rotations, dtype=np.float64)


@dataclass(frozen=True)
class Bundle:
    """A category's network and calibration.

    Attributes
    ----------
    category : str
    network : bytes
        From `nbv.experiment.estimation.export.onnx_model`.
    estimator : mapping
        Its settings.
    camera : Camera
        What it was trained with.
    diagonal_m : float
        Of the bounding box of a usual object, metres.
    extent_m : (float, float)
        Between which the diagonal of an object's box in the image is plausible, metres.
    focal_px : float
        Of the sensor that training simulated: what is assumed where a camera is not known.
    mirror_plane_deg : float or None
        The azimuth of the plane about which objects are symmetric, degrees in [0, 180); see
        `nbv.robot.mirror`. None where there is none.
    temperature : float
        What logits are divided by.
    object_ids : tuple of str
        Of each of S calibration turns: which object it shows.
    elevation_deg : ndarray (S,)
        Of each calibration turn; NaN where it is not known.
    turn_weight : ndarray (S,) float32
        How much each calibration turn counts.
    distributions : ndarray (S, B, B) float32
        p(azimuth | image) of views a bin apart.
    affinity : mapping
        ``power`` and ``pseudo_observations`` of the expected error.
    familiarity : Familiarity
    paper : PaperTables
    provenance : mapping
        Run, commit, versions, settings, and what calibrated it.
    """

    category: str
    network: bytes
    estimator: Mapping[str, Any]
    camera: Camera
    diagonal_m: float
    extent_m: tuple[float, float]
    focal_px: float
    mirror_plane_deg: float | None
    temperature: float
    object_ids: tuple[str, ...]
    elevation_deg: NDArray[np.float32]
    turn_weight: NDArray[np.float32]
    distributions: NDArray[np.float32]
    affinity: Mapping[str, float]
    familiarity: Familiarity
    paper: PaperTables
    provenance: Mapping[str, Any]

    @property
    def n_bins(self) -> int:
        """B, the number of classes."""
        return int(self.distributions.shape[-1])

    def save(self, path: str | Path) -> None:
        """Write a bundle: the same bundle gives the same bytes."""
        about = {
            "format": FORMAT,
            "category": self.category,
            "estimator": dict(self.estimator),
            "camera": asdict(self.camera),
            "diagonal_m": self.diagonal_m,
            "extent_m": list(self.extent_m),
            "focal_px": self.focal_px,
            "mirror_plane_deg": self.mirror_plane_deg,
            "temperature": self.temperature,
            "object_ids": list(self.object_ids),
            "affinity": dict(self.affinity),
            "familiar_within": self.familiarity.threshold,
            "provenance": dict(self.provenance),
        }
        arrays: dict[str, NDArray[Any]] = {
            "network": np.frombuffer(self.network, dtype=np.uint8),
            "calibration.elevation_deg": self.elevation_deg.astype(np.float32),
            "calibration.weight": self.turn_weight.astype(np.float32),
            "calibration.distributions": as_steps(self.distributions),
            "familiarity.mean": self.familiarity.mean,
            "familiarity.basis": self.familiarity.basis.astype(np.float16),
            "familiarity.references": self.familiarity.references.astype(np.float16),
            "familiarity.scales": self.familiarity.scales,
            "paper.elevation_deg": self.paper.elevation_deg,
            "paper.rotation_deg": self.paper.rotation_deg,
        }
        # safetensors writes the memory of an array as it lies, whatever its order.
        arrays = {name: np.asarray(array, order="C") for name, array in arrays.items()}
        # As it is read again. The metadata has one entry: safetensors orders several at random.
        about = json.loads(json.dumps(about))
        about["sha256"] = _digest(about, arrays)
        metadata = {"nbv": json.dumps(about, sort_keys=True)}
        with replacing(path) as temporary:
            temporary.write_bytes(safetensors.numpy.save(arrays, metadata=metadata))

    @classmethod
    def load(cls, path: str | Path) -> Bundle:
        """Read what `save` wrote.

        Raises
        ------
        BundleError
            ``no-bundle`` where the file is missing or another one, ``damaged-bundle`` also where
            it is cut short, ``older-bundle`` and ``newer-bundle`` where it is of another format.
        """
        path = Path(path)
        if not path.is_file():
            raise BundleError(
                "no-bundle", f"{path} {missing(path)}; name a bundle of this package, or a file"
            )
        try:
            about, arrays = _read(path)
            _check_format(path, about["format"])
            if about.pop("sha256") != _digest(about, arrays):
                raise ValueError("not the bytes that were written")
            bundle = _of_parts(about, arrays)
            _need_sound(bundle)
        except BundleError:
            raise
        # No list of what a reader may raise on arbitrary bytes is complete.
        except Exception as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise BundleError(
                "damaged-bundle", f"{path} is no sound bundle ({reason}); get it again"
            ) from error
        return bundle


def as_steps(distributions: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Return distributions as whole steps of -log p, 0 to 255."""
    steps = -np.log(np.maximum(distributions, 1e-30)) / PROBABILITY_STEP
    return np.asarray(np.rint(np.minimum(steps, 255)), dtype=np.uint8)


def from_steps(steps: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return what `as_steps` kept, with rows that sum to 1 again."""
    kept = np.exp(np.arange(256) * -PROBABILITY_STEP).astype(np.float32)[steps]
    return np.asarray(kept / kept.sum(axis=-1, keepdims=True))


def _digest(about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the SHA-256 of all that a bundle holds: a damaged number shows nowhere else."""
    found = hashlib.sha256(json.dumps(about, sort_keys=True).encode())
    for name, array in sorted(arrays.items()):
        found.update(f"{name} {array.dtype} {array.shape}".encode())
        found.update(array.tobytes())
    return found.hexdigest()


def _check_format(path: Path, version: int) -> None:
    if version > FORMAT:
        raise BundleError(
            "newer-bundle",
            f"{path} is a bundle of format {version}, this program reads format {FORMAT}: "
            "install a newer nbv",
        )
    if version < FORMAT:
        raise BundleError(
            "older-bundle",
            f"{path} is a bundle of format {version}, this program reads format {FORMAT}: make it "
            "again with snakemake bundles, or from a bundle of this nbv with nbv calibrate",
        )


def _read(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    with safetensors.safe_open(path, framework="numpy") as stored:
        metadata = stored.metadata() or {}
        if "nbv" not in metadata:
            raise BundleError("no-bundle", f"{path} is no bundle of nbv")
        about = json.loads(metadata["nbv"])
        if "format" not in about:
            raise BundleError(
                "no-bundle", f"{path} is an estimator, no bundle: make one with snakemake bundles"
            )
        return about, {name: stored.get_tensor(name) for name in sorted(stored.keys())}


def _of_parts(about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Bundle:
    low, high = about["extent_m"]
    return Bundle(
        category=about["category"],
        network=arrays["network"].tobytes(),
        estimator=about["estimator"],
        camera=Camera(**about["camera"]),
        diagonal_m=about["diagonal_m"],
        extent_m=(low, high),
        focal_px=about["focal_px"],
        mirror_plane_deg=about["mirror_plane_deg"],
        temperature=about["temperature"],
        object_ids=tuple(about["object_ids"]),
        elevation_deg=arrays["calibration.elevation_deg"],
        turn_weight=arrays["calibration.weight"],
        distributions=from_steps(arrays["calibration.distributions"]),
        affinity=about["affinity"],
        familiarity=Familiarity(
            arrays["familiarity.mean"],
            arrays["familiarity.basis"].astype(np.float32),
            arrays["familiarity.references"].astype(np.float32),
            arrays["familiarity.scales"],
            about["familiar_within"],
        ),
        paper=PaperTables(arrays["paper.elevation_deg"], arrays["paper.rotation_deg"]),
        provenance=about["provenance"],
    )


def _need_sound(bundle: Bundle) -> None:
    n_turns, n_bins = len(bundle.object_ids), bundle.n_bins
    if bundle.distributions.shape != (n_turns, n_bins, n_bins) or not n_turns:
        raise ValueError(f"calibration of {bundle.distributions.shape} for {n_turns} turns")
    if not bundle.elevation_deg.shape == bundle.turn_weight.shape == (n_turns,):
        raise ValueError("an elevation or a weight for each turn is missing")
    if not (bundle.turn_weight > 0).all():
        raise ValueError("a turn has no weight above 0")
    n_tables = len(bundle.paper.elevation_deg)
    if not n_tables or bundle.paper.rotation_deg.shape != (n_tables, 360):
        raise ValueError("the paper's tables are no tables")
    if bundle.estimator["n_classes"] != n_bins or 360 % n_bins:
        raise ValueError(f"{n_bins} bins for {bundle.estimator['n_classes']} classes")
    plane = bundle.mirror_plane_deg
    if plane is not None and not (0 <= plane < 180 and (2 * plane * n_bins / 360).is_integer()):
        raise ValueError(f"a mirror plane at {plane}°")
    numbers = [bundle.diagonal_m, bundle.focal_px, bundle.temperature, bundle.familiarity.threshold]
    if not all(math.isfinite(number) and number > 0 for number in numbers):
        raise ValueError("a size, focal length, temperature or threshold is not above 0")
    arrays = [bundle.turn_weight, bundle.paper.elevation_deg]
    known = bundle.familiarity
    arrays += [known.mean, known.basis, known.references, known.scales]
    if (
        not all(np.isfinite(array).all() for array in arrays)
        or np.isinf(bundle.elevation_deg).any()
    ):
        raise ValueError("a number is not finite")
    if not 0 < bundle.extent_m[0] < bundle.extent_m[1]:
        raise ValueError("the plausible extents are no range")
    if (np.abs(bundle.paper.rotation_deg.astype(np.int64)) > 360).any():
        raise ValueError("a rotation of the paper's tables is more than a full turn")
    n_features, n_components = known.basis.shape
    if not (
        known.mean.shape == (n_features,)
        and known.references.shape[1:] == (n_components,)
        and len(known.references)
        and known.scales.shape == (2, 2)
    ):
        raise ValueError("what is familiar has arrays that do not fit each other")
    if set(bundle.affinity) != {"power", "pseudo_observations"} or not all(
        math.isfinite(value) and value >= 0 for value in bundle.affinity.values()
    ):
        raise ValueError(f"an affinity of {dict(bundle.affinity)}")
    if not isinstance(bundle.provenance, dict):
        raise ValueError("a provenance that is no object")
