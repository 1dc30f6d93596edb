"""Best next-viewpoint recommendation for category-level object pose estimation.

The names in `__all__` are the public API; everything else is internal and may change. From a depth
frame to the next view::

    import nbv

    recommender = nbv.Recommender.load("mug")
    answer = recommender.recommend(depth_m, mask=mask, intrinsics=(fx, fy, cx, cy))
    answer.azimuth_deg, answer.move.rotation_deg

With an estimator of one's own, by the lookup table of its errors::

    table = nbv.LookupTable.load("results/paper/lookup/mug/el00/fold1/pose_ambiguity.npz")
    delta_deg = table.recommend(first_deg)  # rotate the camera, estimate again: second_deg
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
    from nbv.bundles.recommender import Recommender as Recommender
    from nbv.choice.moves import check_axis as check_axis
    from nbv.choice.moves import moved_camera as moved_camera
    from nbv.choice.next_view import Move as Move
    from nbv.choice.next_view import Recommendation as Recommendation
    from nbv.core.circle.density import Conditionals as Conditionals
    from nbv.core.circle.density import conditionals as conditionals
    from nbv.core.circle.evidence import Evidence as Evidence
    from nbv.core.circle.evidence import gather_evidence as gather_evidence
    from nbv.core.circle.fusion import average as average
    from nbv.core.circle.fusion import posterior as posterior
    from nbv.errors import BundleError as BundleError
    from nbv.errors import FrameError as FrameError
    from nbv.errors import UserError as UserError
    from nbv.frames.depth_files import read_depth as read_depth
    from nbv.frames.intrinsics import Intrinsics as Intrinsics
    from nbv.frames.synthetic import example_frame as example_frame
    from nbv.tables.distribution_table import DistributionTable as DistributionTable
    from nbv.tables.lookup import LookupTable as LookupTable
    from nbv.tables.lookup import build_lookup as build_lookup
    from nbv.tables.next_camera import PoseEstimate as PoseEstimate
    from nbv.tables.orientation_table import OrientationTable as OrientationTable
    from nbv.tables.walks import forecast as forecast

__version__ = "0.3.0"

# Names and not imports: `import nbv` stays quick, and no job depends on all of these modules.
_MODULES = {
    "Recommender": "nbv.bundles.recommender",
    "Recommendation": "nbv.choice.next_view",
    "Move": "nbv.choice.next_view",
    "DistributionTable": "nbv.tables.distribution_table",
    "OrientationTable": "nbv.tables.orientation_table",
    "forecast": "nbv.tables.walks",
    "PoseEstimate": "nbv.tables.next_camera",
    "moved_camera": "nbv.choice.moves",
    "check_axis": "nbv.choice.moves",
    "BundleError": "nbv.errors",
    "FrameError": "nbv.errors",
    "Intrinsics": "nbv.frames.intrinsics",
    "read_depth": "nbv.frames.depth_files",
    "example_frame": "nbv.frames.synthetic",
    "Conditionals": "nbv.core.circle.density",
    "conditionals": "nbv.core.circle.density",
    "UserError": "nbv.errors",
    "Evidence": "nbv.core.circle.evidence",
    "gather_evidence": "nbv.core.circle.evidence",
    "average": "nbv.core.circle.fusion",
    "posterior": "nbv.core.circle.fusion",
    "LookupTable": "nbv.tables.lookup",
    "build_lookup": "nbv.tables.lookup",
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
