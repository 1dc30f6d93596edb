"""What commands print."""

import numpy as np
import pytest

from nbv.choice.next_view import Move, Recommendation
from nbv.cli.answers import print_offset, show_answer
from nbv.cli.arguments import StopOptions
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


@pytest.mark.parametrize(("now_deg", "other_deg"), [(4.0, 5.0), (4.0, 2.0), (3.0, 5.0)])
def test_numbers_that_seem_to_contradict_the_answer_have_a_reason(capsys, now_deg, other_deg):
    """A lower number than the first one's, and an error that does not fall."""
    within = dict.fromkeys(("5", "15", "30"), 0.5)
    moves = (
        Move(rotation_deg=r, travel_deg=r, expected_error_deg=error, probability_within=within)
        for r, error in ((180.0, 3.0), (90.0, other_deg))
    )
    answer = Recommendation(
        azimuth_deg=0.0,
        spread_deg=9.0,
        expected_error_deg=now_deg,
        probability_within=within,
        moves=tuple(moves),
        belief=np.full(4, 0.25),
        error_after_deg=np.zeros(4),
        bayes_factor=1.0,
        n_views=1,
    )
    show_answer(answer, StopOptions(), as_json=False, has_targets=False)
    decision, *_, others = capsys.readouterr().out.splitlines()
    assert (decision.endswith("3.0°"), others.endswith(")")) == (now_deg > 3, other_deg > 3)
