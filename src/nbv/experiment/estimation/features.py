"""Depth features: the hidden layer of a network that was trained on objects of no experiment.

The package ships that network, trained on procedural objects of the seeds from
`nbv.core.seeds.FIRST_FEATURE_SEED` on.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import onnxruntime
import safetensors
from numpy.typing import NDArray

from nbv.errors import UserError
from nbv.files import damaged, readable
from nbv.robot.network import open_session

SHIPPED: Final = Path(__file__).with_name("features.safetensors")

BATCH = 256
"""Images per batch: with 1,024, onnxruntime leaves the processor's cache."""


@dataclass(frozen=True)
class Features:
    """The network in onnxruntime, and how it was trained.

    Attributes
    ----------
    session : onnxruntime.InferenceSession
    n_features : int
    image_side : int
        Pixels.
    provenance : dict
    """

    session: onnxruntime.InferenceSession
    n_features: int
    image_side: int
    provenance: dict[str, Any]

    @staticmethod
    def load(path: Path = SHIPPED) -> Features:
        """Read a file of `nbv.experiment.estimation.weights.save_features`.

        Raises
        ------
        UserError
            Where the file is missing or damaged.
        """
        with readable(path), safetensors.safe_open(path, framework="numpy") as stored:
            history = (stored.metadata() or {}).get("nbv")
            if history is None or "onnx" not in stored.keys():  # noqa: SIM118
                raise damaged(path, "holds no features of nbv")
            session = open_session(stored.get_tensor("onnx").tobytes())
            provenance = json.loads(history)
        ends = {end.name: end.shape for end in (*session.get_inputs(), *session.get_outputs())}
        return Features(session, ends["hidden"][1], ends["codes"][2], provenance)

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
        batches = [
            self.session.run(["hidden"], {"codes": codes[i : i + BATCH, None].astype(np.float32)})
            for i in range(0, len(codes), BATCH)
        ]
        return np.concatenate([hidden for (hidden,) in batches])

    def of_both(self, codes: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Return the even and the odd part of the features of images, (n, 2 n_features).

        These are half the sum and half the difference of the features of an image and of its mirror
        image. The mirror image has the same even part, and the odd part with the other sign.
        """
        own, mirrored = self.of(codes), self.of(codes[..., ::-1])
        return np.asarray(np.concatenate([own + mirrored, own - mirrored], axis=1) / 2, np.float32)
