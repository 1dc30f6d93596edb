"""A bundle: a trained network and its calibration data, in one file.

The file has the safetensors format: arrays, and metadata as JSON. It holds no code. The network is
an ONNX model. Calibration distributions are stored as logarithms of one byte, in steps of
`PROBABILITY_STEP`.
"""

from __future__ import annotations

import hashlib
import json
import math
import operator
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import safetensors.numpy
from numpy.typing import ArrayLike, NDArray

from nbv.bundles.ood import CELLS, OodModel
from nbv.core.circle.angles import nearest_bin
from nbv.core.circle.logits import TEMPERATURES
from nbv.data.camera import Camera
from nbv.errors import BundleError
from nbv.files import missing, replacing

FORMAT = 4
"""Increased when the file changes; a program reads only its own format."""

PROBABILITY_STEP = 0.054
"""Step of stored log probabilities, nats: 256 steps reach down to 1e-6."""


_LEAST, _MOST = 1e-9, 1e6
"""Bounds of a bundle's positive numbers, between which single precision stays finite."""

ELEVATION_BANDWIDTH_DEG = 10.0
"""Width of the kernel by which calibration sweeps count for frames at another elevation."""


@dataclass(frozen=True)
class PaperTables:
    """The paper's lookup tables, one for each elevation.

    Attributes
    ----------
    elevation_deg : ndarray (E,) float32
    rotation_deg : ndarray (E, 360) int16
        The rotation of least pose ambiguity for each estimate, degrees in [0, 360).
    """

    elevation_deg: NDArray[np.float32]
    rotation_deg: NDArray[np.int16]

    def table_index(self, elevation_deg: float) -> int:
        """Return the index of the table nearest to an elevation; 0 where it is unknown (NaN)."""
        return int(np.nan_to_num(np.abs(self.elevation_deg - elevation_deg)).argmin())

    def recommend(self, estimate_deg: ArrayLike, elevation_deg: float) -> NDArray[np.float64]:
        """Return the rotations for estimates, from the table nearest to an elevation."""
        table = self.rotation_deg[self.table_index(elevation_deg)]
        rotations = table[nearest_bin(estimate_deg, len(table))]
        return np.asarray(rotations, dtype=np.float64)


@dataclass(frozen=True)
class Bundle:
    """A category's network and calibration.

    Attributes
    ----------
    network : bytes
        From `nbv.experiment.estimation.export.onnx_model`.
    estimator : mapping
        Settings of the network.
    camera : Camera
        The camera of the training images.
    diagonal_m : float
        Diagonal of the bounding box of a typical object, metres.
    extent_m : (float, float)
        Plausible range of the diagonal of an object's box in the image, metres.
    focal_px : float
        Focal length of the simulated sensor, pixels; assumed where a camera is unknown.
    mirror_plane_deg : float or None
        Azimuth of the plane about which objects are symmetric, degrees in [0, 180); see
        `nbv.bundles.network`. None if they have no such plane.
    temperature : float
        Divisor of the logits.
    object_ids : tuple of str
        The object in each of S calibration sweeps.
    elevation_deg : ndarray (S,)
        Elevation of each calibration sweep; NaN where it is unknown.
    sweep_weights : ndarray (S,) float32
        Weight of each calibration sweep.
    distributions : ndarray (S, B, B) float32
        p(azimuth | image) of views a bin apart.
    affinity : mapping
        ``power`` and ``pseudo_observations`` of the expected error.
    provenance : mapping
        Run, commit, versions, settings, and the source of the calibration.
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
    sweep_weights: NDArray[np.float32]
    distributions: NDArray[np.float32]
    affinity: Mapping[str, float]
    ood: OodModel
    paper: PaperTables
    provenance: Mapping[str, Any]

    @property
    def n_bins(self) -> int:
        """Number of classes, B."""
        return int(self.distributions.shape[-1])

    def weights_at(self, elevation_deg: float | None) -> NDArray[np.float64]:
        """Return the weights (S,) of the calibration sweeps for frames at an elevation.

        None or NaN where the elevation is unknown: every sweep then has its own weight.
        """
        weights = np.asarray(self.sweep_weights, dtype=np.float64)
        if elevation_deg is None:
            return weights
        return weights * elevation_weights(self.elevation_deg, elevation_deg)

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
            "familiar_within": self.ood.threshold,
            "provenance": dict(self.provenance),
        }
        arrays: dict[str, NDArray[Any]] = {
            "network": np.frombuffer(self.network, dtype=np.uint8),
            "calibration.elevation_deg": self.elevation_deg.astype(np.float32),
            "calibration.weight": self.sweep_weights.astype(np.float32),
            "calibration.distributions": quantize_logp(self.distributions),
            "familiarity.mean": self.ood.mean,
            "familiarity.basis": self.ood.basis.astype(np.float16),
            "familiarity.references": self.ood.references.astype(np.float16),
            "familiarity.scales": self.ood.scales,
            "paper.elevation_deg": self.paper.elevation_deg,
            "paper.rotation_deg": self.paper.rotation_deg,
        }
        # safetensors writes the memory of an array as it lies, whatever its order.
        arrays = {name: np.asarray(array, order="C") for name, array in arrays.items()}
        # As `load` reads it. The metadata has one entry, because safetensors orders several at
        # random.
        about = json.loads(json.dumps(about))
        about["sha256"] = _digest(about, arrays)
        metadata = {"nbv": json.dumps(about, sort_keys=True)}
        with replacing(path) as temporary:
            temporary.write_bytes(safetensors.numpy.save(arrays, metadata=metadata))

    @classmethod
    def load(cls, path: str | Path) -> Bundle:
        """Read a file of `save`.

        Raise BundleError ``no-bundle`` where the file is missing or is not a bundle,
        ``damaged-bundle`` where it was changed or cut short, ``older-bundle`` or ``newer-bundle``
        for another format.
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
                raise ValueError("its checksum differs")
            bundle = _bundle_of(about, arrays)
            _check_sound(bundle)
        except BundleError:
            raise
        # A reader may raise any exception on arbitrary bytes.
        except Exception as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise BundleError(
                "damaged-bundle", f"{path} is damaged ({reason}); get it again"
            ) from error
        return bundle


def elevation_weights(known_deg: NDArray[np.floating], elevation_deg: float) -> NDArray[np.float64]:
    """Return the weights (S,) of calibration sweeps at elevations `known_deg` (S,) for frames.

    The weight falls off as a normal kernel of `ELEVATION_BANDWIDTH_DEG`; the nearest sweep has the
    weight 1. A sweep of unknown elevation (NaN) has the weight 1, and so has every sweep where
    `elevation_deg` is NaN.
    """
    if math.isnan(elevation_deg) or np.isnan(known_deg).all():
        return np.ones(len(known_deg))
    apart = ((known_deg - elevation_deg) / ELEVATION_BANDWIDTH_DEG) ** 2
    weights = np.exp(-0.5 * (apart - np.nanmin(apart)))
    return np.asarray(np.nan_to_num(weights, nan=1.0), dtype=np.float64)


def quantize_logp(distributions: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Return -log p of distributions in steps of `PROBABILITY_STEP`, 0 to 255."""
    steps = -np.log(np.maximum(distributions, 1e-30)) / PROBABILITY_STEP
    return np.asarray(np.rint(np.minimum(steps, 255)), dtype=np.uint8)


def dequantize_logp(steps: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the distributions of `quantize_logp`, normalised again."""
    rows = np.exp(np.arange(256) * -PROBABILITY_STEP).astype(np.float32)[steps]
    return np.asarray(rows / rows.sum(axis=-1, keepdims=True))


def _digest(about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the SHA-256 of a bundle's content, which detects damaged numbers."""
    digest = hashlib.sha256(json.dumps(about, sort_keys=True, allow_nan=False).encode())
    for name, array in sorted(arrays.items()):
        digest.update(f"{name} {array.dtype} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def _check_format(path: Path, version: Any) -> None:
    if type(version) is not int or version < 1:
        raise ValueError(f"format {version!r}")
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
            raise BundleError("no-bundle", f"{path} is not a bundle of nbv; name one")
        about = json.loads(metadata["nbv"])
        if "format" not in about:
            raise BundleError(
                "no-bundle",
                f"{path} is an estimator and not a bundle: make one with snakemake bundles",
            )
        return about, {name: stored.get_tensor(name) for name in sorted(stored.keys())}


def _bundle_of(about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Bundle:
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
        sweep_weights=arrays["calibration.weight"],
        distributions=dequantize_logp(
            arrays["calibration.distributions"].astype(np.uint8, casting="safe")
        ),
        affinity={key: about["affinity"][key] for key in ("power", "pseudo_observations")},
        ood=OodModel(
            arrays["familiarity.mean"],
            arrays["familiarity.basis"].astype(np.float32),
            arrays["familiarity.references"].astype(np.float32),
            arrays["familiarity.scales"],
            about["familiar_within"],
        ),
        paper=PaperTables(arrays["paper.elevation_deg"], arrays["paper.rotation_deg"]),
        provenance=about["provenance"],
    )


def _check_sound(bundle: Bundle) -> None:
    """Raise ValueError for values that `make_bundle` and `recalibrated` never write."""
    n_sweeps, n_bins = len(bundle.object_ids), bundle.n_bins
    model, paper, camera = bundle.ood, bundle.paper, bundle.camera
    n_features = 2 * min(CELLS, operator.index(camera.image_side)) ** 2
    shapes: dict[str, tuple[NDArray[Any], tuple[int, ...]]] = {
        "calibration.distributions": (bundle.distributions, (n_sweeps, n_bins, n_bins)),
        "calibration.elevation_deg": (bundle.elevation_deg, (n_sweeps,)),
        "calibration.weight": (bundle.sweep_weights, (n_sweeps,)),
        "familiarity.mean": (model.mean, (n_features,)),
        "familiarity.basis": (model.basis.T[:1], (1, n_features)),
        "familiarity.references": (model.references[:1], (1, model.basis.shape[-1])),
        "familiarity.scales": (model.scales, (2, 2)),
        "paper.rotation_deg": (paper.rotation_deg, (len(paper.elevation_deg), 360)),
    }
    for name, (array, shape) in shapes.items():
        if array.shape != shape or not array.size:
            raise ValueError(f"{name} of shape {array.shape} instead of {shape}")
    plane = bundle.mirror_plane_deg
    ranges: dict[str, tuple[Any, float, float]] = {
        "calibration.elevation_deg": (np.nan_to_num(bundle.elevation_deg), -90, 90),
        "calibration.weight": (bundle.sweep_weights, _LEAST, _MOST),
        "familiarity.mean": (model.mean, -_MOST, _MOST),
        "familiarity.basis": (model.basis, -_MOST, _MOST),
        "familiarity.references": (model.references, -_MOST, _MOST),
        "familiarity.scales": (model.scales, -_MOST, _MOST),
        "familiarity.scales, the deviations": (model.scales[:, 1], _LEAST, _MOST),
        "familiar_within": (model.threshold, _LEAST, _MOST),
        "paper.elevation_deg": (paper.elevation_deg, -90, 90),
        "paper.rotation_deg": (paper.rotation_deg, 0, 359),
        "mirror_plane_deg": (0 if plane is None else plane, 0, 180 - 180 / n_bins),
        "temperature": (bundle.temperature, *TEMPERATURES),
        "camera.distance": (camera.distance, _LEAST, _MOST),
        "camera.roll_deg": (camera.roll_deg, -360, 360),
        "diagonal_m": (bundle.diagonal_m, _LEAST, _MOST),
        "focal_px": (bundle.focal_px, _LEAST, _MOST),
        "extent_m[0]": (bundle.extent_m[0], _LEAST, _MOST),
        "extent_m[1]": (bundle.extent_m[1], bundle.extent_m[0], _MOST),
        "affinity.power": (bundle.affinity["power"], 0, _MOST),
        "affinity.pseudo_observations": (bundle.affinity["pseudo_observations"], 0, _MOST),
        "provenance.turns_made_with": (bundle.provenance.get("turns_made_with", 1), 1, _MOST),
    }
    for name, (values, least, most) in ranges.items():
        array = np.asarray(values)
        if array.dtype.kind not in "iuf" or not ((array >= least) & (array <= most)).all():
            raise ValueError(f"{name} is not in {least:g} to {most:g}")
    if bundle.estimator["n_classes"] != n_bins or 360 % n_bins:
        raise ValueError(f"{n_bins} bins for {bundle.estimator['n_classes']} classes")
    if plane is not None and 2 * plane * n_bins % 360:
        raise ValueError(f"a mirror plane at {plane}°")
    if not all(isinstance(text, str) for text in (bundle.category, *bundle.object_ids)):
        raise ValueError("a name is not a text")
