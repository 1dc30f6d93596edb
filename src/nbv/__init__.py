"""Best next-viewpoint recommendation for category-level object pose estimation.

The names in `__all__` are the public API; everything else is internal and may change. From a depth
frame to the next view::

    import nbv

    recommender = nbv.Recommender.load("mug")
    answer = recommender.recommend(depth_m, mask=mask, intrinsics=(fx, fy, cx, cy))
    answer.azimuth_deg, answer.move.rotation_deg

With an estimator of one's own, by the lookup table of its errors::

    table = nbv.LookupTable.load("results/paper/lookup/mug/el00/fold1/pose_ambiguity.npz")
    delta_deg = table.recommend(first_deg)  # turn the camera, estimate again: second_deg
    pose_deg = nbv.average(first_deg, second_deg, delta_deg)

`build_lookup` makes a table of the evidence that `gather_evidence` makes of calibration estimates.
"""

import sys
import warnings
from importlib import import_module
from operator import attrgetter
from typing import TYPE_CHECKING, Any

# What type checkers see of the names below.
if TYPE_CHECKING:
    from nbv.core.density import Conditionals as Conditionals
    from nbv.core.density import conditionals as conditionals
    from nbv.core.evidence import Evidence as Evidence
    from nbv.core.evidence import gather_evidence as gather_evidence
    from nbv.core.fusion import average as average
    from nbv.core.fusion import posterior as posterior
    from nbv.errors import BundleError as BundleError
    from nbv.errors import FrameError as FrameError
    from nbv.errors import UserError as UserError
    from nbv.robot.depth_files import read_depth as read_depth
    from nbv.robot.distribution_table import DistributionTable as DistributionTable
    from nbv.robot.intrinsics import Intrinsics as Intrinsics
    from nbv.robot.lookup import LookupTable as LookupTable
    from nbv.robot.lookup import build_lookup as build_lookup
    from nbv.robot.moves import check_axis as check_axis
    from nbv.robot.moves import moved_camera as moved_camera
    from nbv.robot.next_camera import PoseEstimate as PoseEstimate
    from nbv.robot.next_view import Move as Move
    from nbv.robot.next_view import Recommendation as Recommendation
    from nbv.robot.recommender import Recommender as Recommender
    from nbv.robot.rotation_pairs import OrientationTable as OrientationTable
    from nbv.robot.synthetic import example_frame as example_frame

__version__ = "0.2.0"

# Names and not imports: `import nbv` stays quick, and no job depends on all of these modules.
_MODULES = {
    "Recommender": "nbv.robot.recommender",
    "Recommendation": "nbv.robot.next_view",
    "Move": "nbv.robot.next_view",
    "DistributionTable": "nbv.robot.distribution_table",
    "OrientationTable": "nbv.robot.rotation_pairs",
    "PoseEstimate": "nbv.robot.next_camera",
    "moved_camera": "nbv.robot.moves",
    "check_axis": "nbv.robot.moves",
    "BundleError": "nbv.errors",
    "FrameError": "nbv.errors",
    "Intrinsics": "nbv.robot.intrinsics",
    "read_depth": "nbv.robot.depth_files",
    "example_frame": "nbv.robot.synthetic",
    "Conditionals": "nbv.core.density",
    "conditionals": "nbv.core.density",
    "UserError": "nbv.errors",
    "Evidence": "nbv.core.evidence",
    "gather_evidence": "nbv.core.evidence",
    "average": "nbv.core.fusion",
    "posterior": "nbv.core.fusion",
    "LookupTable": "nbv.robot.lookup",
    "build_lookup": "nbv.robot.lookup",
}

# Former names, for one release.
_FORMER = {
    "RotationPairs": "OrientationTable",
    "View": "PoseEstimate",
    "recommend_camera": "OrientationTable.recommend",
}

__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    """Import what the public API names when it is first asked for."""
    if name in _FORMER:
        new = _FORMER[name]
        message = f"nbv.{name} is now nbv.{new}; the old name goes with the next release"
        warnings.warn(message, DeprecationWarning, stacklevel=2)
        return attrgetter(new)(sys.modules[__name__])
    if name not in _MODULES:
        raise AttributeError(f"module 'nbv' has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    """Return the public names, too, which are not imported yet."""
    return sorted({*globals(), *__all__})
