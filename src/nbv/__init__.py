"""Best next-viewpoint recommendation for category-level object pose estimation.

The names in `__all__` are the public API; everything else is internal and may change. From a depth
frame to the next view::

    import nbv

    recommender = nbv.Recommender.load("mug")
    answer = recommender.recommend(depth_m, mask=mask, intrinsics=(fx, fy, cx, cy))
    answer.azimuth_deg, answer.move.rotation_deg

With an estimator of one's own, by the lookup table of its errors::

    table = nbv.load_lookup("results/paper/lookup/mug/el00/fold1/pose_ambiguity.npz")
    delta_deg = table.recommend(first_deg)  # turn the camera, estimate again: second_deg
    pose_deg = nbv.average(first_deg, second_deg, delta_deg)

`build_lookup` makes a table of the evidence that `gather_evidence` makes of calibration estimates.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

# What type checkers see of the names below.
if TYPE_CHECKING:
    from nbv.bundles.bundle import BundleError as BundleError
    from nbv.bundles.distribution_tables import DistributionTable as DistributionTable
    from nbv.bundles.moves import check_axis as check_axis
    from nbv.bundles.moves import moved_camera as moved_camera
    from nbv.bundles.next_view import Move as Move
    from nbv.bundles.next_view import Recommendation as Recommendation
    from nbv.bundles.recommender import Recommender as Recommender
    from nbv.calibration.density import Conditionals as Conditionals
    from nbv.calibration.density import conditionals as conditionals
    from nbv.errors import UserError as UserError
    from nbv.frames.depth_files import read_depth as read_depth
    from nbv.frames.drawn import example_frame as example_frame
    from nbv.frames.errors import FrameError as FrameError
    from nbv.frames.intrinsics import Intrinsics as Intrinsics
    from nbv.recommendation.evidence import Evidence as Evidence
    from nbv.recommendation.evidence import gather_evidence as gather_evidence
    from nbv.recommendation.fusion import average as average
    from nbv.recommendation.fusion import posterior as posterior
    from nbv.recommendation.lookup import LookupTable as LookupTable
    from nbv.recommendation.lookup import build_lookup as build_lookup
    from nbv.recommendation.lookup import load_lookup as load_lookup
    from nbv.recommendation.lookup import save_lookup as save_lookup

__version__ = "0.1.0"

# Names and not imports: `import nbv` stays quick, and no job depends on all of these modules.
_MODULES = {
    "Recommender": "nbv.bundles.recommender",
    "Recommendation": "nbv.bundles.next_view",
    "Move": "nbv.bundles.next_view",
    "DistributionTable": "nbv.bundles.distribution_tables",
    "moved_camera": "nbv.bundles.moves",
    "check_axis": "nbv.bundles.moves",
    "BundleError": "nbv.bundles.bundle",
    "FrameError": "nbv.frames.errors",
    "Intrinsics": "nbv.frames.intrinsics",
    "read_depth": "nbv.frames.depth_files",
    "example_frame": "nbv.frames.drawn",
    "Conditionals": "nbv.calibration.density",
    "conditionals": "nbv.calibration.density",
    "UserError": "nbv.errors",
    "Evidence": "nbv.recommendation.evidence",
    "gather_evidence": "nbv.recommendation.evidence",
    "average": "nbv.recommendation.fusion",
    "posterior": "nbv.recommendation.fusion",
    "LookupTable": "nbv.recommendation.lookup",
    "build_lookup": "nbv.recommendation.lookup",
    "load_lookup": "nbv.recommendation.lookup",
    "save_lookup": "nbv.recommendation.lookup",
}

__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    """Import what the public API names when it is first asked for."""
    if name not in _MODULES:
        raise AttributeError(f"module 'nbv' has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    """Return the public names, too, which are not imported yet."""
    return sorted({*globals(), *__all__})
