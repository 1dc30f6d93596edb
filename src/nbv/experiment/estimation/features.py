"""Depth features: the hidden layer of a network that was trained on objects of no experiment.

The package ships that network, trained on procedural objects of the seeds from
`nbv.core.seeds.FIRST_FEATURE_SEED` on.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import safetensors
from numpy.typing import NDArray

from nbv.bundles.network import Network, open_network
from nbv.errors import UserError
from nbv.files import damaged, readable

SHIPPED: Final = Path(__file__).with_name("features.safetensors")

BATCH = 256
"""Images per batch: with 1,024, onnxruntime leaves the processor's cache."""


def read_features_provenance(path: Path = SHIPPED) -> dict[str, Any]:
    """Return how the network was trained: ``settings``, versions, ``image_side``, ``n_features``.

    Raises
    ------
    UserError
        Where the file is missing, damaged or no file of features.
    """
    with readable(path), safetensors.safe_open(path, framework="numpy") as stored:
        provenance = json.loads((stored.metadata() or {}).get("nbv", "{}"))
    if "n_features" not in provenance:
        raise damaged(path, "holds no depth features")
    return dict(provenance)


@dataclass(frozen=True)
class Features:
    """The network, and how it was trained.

    Attributes
    ----------
    network : callable
        Maps codes (n, side, side) to features (n, n_features).
    image_side : int
        Pixels.
    """

    network: Network
    n_features: int
    image_side: int
    provenance: Mapping[str, Any]

    @staticmethod
    def load(path: Path = SHIPPED) -> Features:
        """Read a file of `nbv.experiment.estimation.features_network.save_features`.

        Raises
        ------
        UserError
            Where the file is missing or damaged.
        """
        provenance = read_features_provenance(path)
        side, n_features = provenance["image_side"], provenance["n_features"]
        with readable(path), safetensors.safe_open(path, framework="numpy") as stored:
            model = stored.get_tensor("onnx").tobytes()
        network = open_network(model, side, n_features, "hidden")
        return Features(network, n_features, side, provenance)

    def of(self, codes: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Return the features (n, n_features) of depth codes (n, side, side).

        Raises
        ------
        UserError
            Where the images have another size.
        """
        side = self.image_side
        if codes.shape[1:] != (side, side):
            raise UserError(
                f"camera.image_side={codes.shape[-1]}: the depth features are of images of {side} "
                f"pixels a side; give {side}, or an estimator that is trained"
            )
        batches = range(0, len(codes), BATCH)
        return np.concatenate([self.network(codes[i : i + BATCH]) for i in batches])

    def of_both(self, codes: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Return the even and the odd part of the features of images, (n, 2 n_features).

        These are half the sum and half the difference of the features of an image and of its mirror
        image. The mirror image has the same even part, and the odd part with the other sign.
        """
        plain, mirrored = self.of(codes), self.of(codes[..., ::-1])
        return np.asarray(
            np.concatenate([plain + mirrored, plain - mirrored], axis=1) / 2, np.float32
        )
