"""What commands print."""

import numpy as np
import pytest

from nbv.cli.answers import print_offset
from nbv.core.circle.offset import FOR_FRAMES, Offset, frame_warning


@pytest.mark.parametrize(
    ("change", "is_added", "warning"),
    [
        (lambda azimuth: azimuth + 14, True, None),
        (lambda azimuth: azimuth - 90, True, "offset -90.0°: azimuth origins probably differ"),
        (lambda azimuth: azimuth + 170 * (azimuth > 80), True, "is each frame's azimuth right?"),
        (lambda azimuth: -azimuth, False, "estimates run opposite to azimuths"),
        (lambda azimuth: np.radians(azimuth), False, "estimates are radians"),
    ],
)
def test_an_offset_of_frames_is_added_and_a_large_one_told(capsys, change, is_added, warning):
    azimuth_deg = np.arange(0.0, 360.0, 10.0)
    estimate_deg = change(azimuth_deg) % 360
    found = Offset.of(azimuth_deg, estimate_deg, FOR_FRAMES)
    assert (frame_warning(azimuth_deg, estimate_deg) == "") == is_added
    print_offset("cup", "36 frames", found, is_added=is_added)
    head, *told = capsys.readouterr().out.splitlines()
    assert head.endswith(", added to the azimuths") == is_added
    if warning is None:
        assert not told
        assert found.warning is None
    else:
        assert told == [f"warning: {found.warning}"]
        assert warning in told[0]
