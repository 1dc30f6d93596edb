"""From frames to the pose and the next view."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from made_bundles import BINS, COLUMNS, FOCAL_PX, ROWS, WIDTH, frame, random_codes, random_estimator
from made_bundles import settings as made_settings
from nbv.bundles.bundle import elevation_weights
from nbv.bundles.ood import ood_score
from nbv.bundles.recommender import Recommender
from nbv.choice.next_view import after_rotations, next_view
from nbv.choice.rotations import MIN_SEPARATION_DEG, N_ALTERNATIVES
from nbv.core.alike.expected import expected_errors
from nbv.core.circle.angles import circular_distance_deg, travel_deg
from nbv.core.circle.distributions import direction_and_spread_deg, mean_direction_deg
from nbv.core.circle.logits import from_logits
from nbv.errors import FrameError, UserError
from nbv.experiment.estimation.make_bundle import bundled_model
from nbv.frames.intrinsics import Intrinsics
from nbv.frames.synthetic import draw_frame, example_frame, example_mesh

HERE = np.arange(BINS) * WIDTH
FRAMES = [frame(seed) for seed in range(4)]
seeds = st.integers(0, 10**6)
whole = st.integers(-BINS, BINS)


def codes_of(seed: int, n: int) -> np.ndarray:
    return random_codes(np.random.default_rng(seed), n)


def telling(bundle, sureness: float = 8.0) -> Recommender:
    """A recommender whose network reads the azimuth's class off the first pixel of a crop."""
    made = Recommender(bundle)

    def network(codes):
        classes = codes[:, 0, 0].astype(int)
        apart = np.radians((np.arange(BINS) - classes[:, None]) * WIDTH)
        return (sureness * np.cos(apart)).astype(np.float32)

    made.network = network
    return made


def told(*classes: int) -> np.ndarray:
    codes = np.zeros((len(classes), 32, 32), dtype=np.uint8)
    codes[:, 0, 0] = np.array(classes) % BINS
    return codes


# Beliefs


@settings(max_examples=25)
@given(seed=seeds, rotations=st.lists(whole, min_size=0, max_size=3))
def test_the_belief_is_that_of_the_last_frame(recommender, seed, rotations):
    rotations = [0.0, *(rotation * WIDTH for rotation in rotations)]
    if any_repeated(rotations):
        return
    codes = codes_of(seed, len(rotations))
    found = recommender.recommend_crops(codes, rotations)
    rows = recommender.distributions(codes)
    # By its definition: the product at the azimuths that each frame then had.
    wanted = np.ones(BINS)
    for row, rotation in zip(rows, rotations, strict=True):
        bins = round((rotation - rotations[-1]) / WIDTH)
        wanted *= row[(np.arange(BINS) + bins) % BINS]
    assert found.belief == pytest.approx(wanted / wanted.sum(), rel=1e-6, abs=1e-12)
    assert found.belief.sum() == pytest.approx(1.0)
    mean = mean_direction_deg(found.belief[None])[0]
    assert circular_distance_deg(found.azimuth_deg, mean) < 1e-6
    assert 0 <= found.azimuth_deg < 360
    assert found.spread_deg == pytest.approx(direction_and_spread_deg(found.belief)[1])


def any_repeated(rotations) -> bool:
    """Whether a rotation leaves too little room: frames everywhere, or one taken twice."""
    return len({round(rotation / WIDTH) % BINS for rotation in rotations}) < len(rotations)


@pytest.mark.parametrize("rotation", [-100.0, 7.5, 20.0, 359.0])
def test_a_rotation_between_the_bins_is_followed(bundle, rotation):
    """The second frame sees the azimuth that the first frame and the rotation imply."""
    made, first = telling(bundle), 5 * WIDTH
    classes = np.arange(BINS) * WIDTH
    second = np.radians(classes - first - rotation)

    def network(codes):
        rows = np.stack([np.cos(np.radians(classes - first)), np.cos(second)])
        return (5 * rows).astype(np.float32)

    made.network = network
    found = made.recommend_crops(told(0, 0), [0.0, rotation])
    assert circular_distance_deg(found.azimuth_deg, first + rotation) < 1.0


@pytest.mark.parametrize("together", [list, np.ma.stack])
def test_what_a_masked_array_masks_counts_as_nothing(recommender, together):
    """Neither were its depths measured, nor does it show the object where it masks."""
    top = np.zeros(FRAMES[0].shape, dtype=bool)
    top[: ROWS // 2] = True
    rotations = [0.0, 60.0]
    wanted = recommender.recommend(
        [np.where(top, 0, one) for one in FRAMES[:2]], rotations_deg=rotations
    )
    depths = together([np.ma.array(one, mask=top) for one in FRAMES[:2]])
    masks = together([np.ma.array(one > 0, mask=top) for one in FRAMES[:2]])
    for found in (
        recommender.recommend(depths, rotations_deg=rotations),
        recommender.recommend(FRAMES[:2], mask=masks, rotations_deg=rotations),
    ):
        assert np.array_equal(found.crops, wanted.crops)


# Which frame is called the first


@settings(max_examples=25)
@given(
    seed=seeds,
    order=st.permutations(range(2)),
    bins=st.permutations([0, 3, 8, 13, 18]).map(lambda places: places[:3]),
)
def test_it_does_not_matter_which_frame_is_called_the_first(recommender, seed, order, bins):
    """The same three frames, the same one last: the others in any order, and any place as 0."""
    codes = codes_of(seed, 3)
    answers = []
    for places in ([0, 1, 2], [*order, 2]):
        rotations = [(bins[place] - bins[places[0]]) * WIDTH for place in places]
        answers.append(recommender.recommend_crops(codes[places], rotations))
    one, other = answers
    assert circular_distance_deg(one.azimuth_deg, other.azimuth_deg) < 1e-6
    assert one.belief == pytest.approx(other.belief, rel=1e-6, abs=1e-12)
    assert one.expected_error_deg == pytest.approx(other.expected_error_deg, rel=1e-3)
    assert one.error_after_deg == pytest.approx(other.error_after_deg, rel=1e-3)
    assert one.move.expected_error_deg == pytest.approx(other.move.expected_error_deg, rel=1e-3)
    assert one.ood_score == other.ood_score


@settings(max_examples=25)
@given(seed=seeds, bins=st.integers(2, BINS - 2))
def test_another_frame_as_the_last_turns_the_answer(recommender, seed, bins):
    codes = codes_of(seed, 2)
    one = recommender.recommend_crops(codes, [0.0, bins * WIDTH])
    other = recommender.recommend_crops(codes[::-1], [0.0, -bins * WIDTH])
    # Single precision: what an image's logits are depends a little on its place among others.
    assert circular_distance_deg(one.azimuth_deg, other.azimuth_deg + bins * WIDTH) < 1e-2
    assert one.belief == pytest.approx(np.roll(other.belief, bins), rel=1e-4, abs=1e-12)
    rotated_back = np.roll(other.error_after_deg, -bins)
    assert one.error_after_deg == pytest.approx(rotated_back, rel=1e-3)


# Expected errors


def brute_force(bundle, rows, bins, share=None, limits=True):
    """From the definitions: the expected error now, those after each rotation from the last frame,
    and by how much the choice of the least of these makes it too low."""
    power, pseudo = bundle.affinity["power"], bundle.affinity["pseudo_observations"]
    views = bundle.distributions.astype(float)
    belief = np.ones(BINS)
    for row, rotation in zip(rows, bins, strict=True):
        belief *= np.roll(row, -rotation)
    agreement = min(np.log(belief.sum() * BINS ** (len(bins) - 1)), 0.0)
    belief /= belief.sum()
    weights, now, after = [], [], []
    for sweep, own in enumerate(views):
        for first in range(BINS):
            product = np.ones(BINS)
            for rotation in bins:
                product *= np.roll(own[(first + rotation) % BINS], -rotation)
            agreed = min(np.log(product.sum() * BINS ** (len(bins) - 1)), 0.0)
            product /= product.sum()
            affinity = WIDTH * np.sqrt(belief * product).sum() ** power
            affinity *= np.exp(-((agreed - agreement) ** 2) / 2)
            weights.append(affinity * (1.0 if share is None else share[sweep]))
            now.append(error_of(product, first))
            after.append(
                [
                    error_of(
                        product * np.roll(own[(first + bins[-1] + d) % BINS], -bins[-1] - d), first
                    )
                    for d in range(BINS)
                ]
            )
    weights, now, after = np.array(weights), np.array(now), np.array(after)
    prior = np.ones(len(views)) if share is None else share
    prior = np.repeat(prior, BINS) * pseudo / (prior.sum() * BINS)
    total = weights + prior
    taken = WIDTH * (np.array(bins) - bins[-1])
    may = (circular_distance_deg(HERE[:, None], taken).min(axis=1) >= MIN_SEPARATION_DEG) & limits
    names = sorted(set(bundle.object_ids))
    more = 0.0
    best = np.where(may, total @ after, np.inf).argmin()
    for part in range(min(5, len(names))):
        own = np.array([name in names[part::5] for name in bundle.object_ids]).repeat(BINS)
        of_others = np.where(may, total @ after - weights[own] @ after[own], np.inf).argmin()
        more += weights[own] @ (after[own, of_others] - after[own, best])
    sums = total.sum()
    more = more / sums if len(names) > 1 else 0.0
    return total @ now / sums, total @ after / sums, more


def error_of(product, first) -> float:
    angles = 2 * np.pi * np.arange(BINS) / BINS
    mean = np.degrees(np.angle((product * np.exp(1j * angles)).sum()))
    return abs((mean - first * WIDTH + 180) % 360 - 180)


@pytest.mark.parametrize("bins", [(0,), (0, 6), (0, -5), (0, 7, 16)])
@pytest.mark.parametrize("elevation", [None, 12.0])
@pytest.mark.parametrize("followed", [True, False])
def test_expected_errors_are_those_of_objects_that_look_alike(
    recommender, bins, elevation, followed
):
    """The errors that chose the last view are expected of it too, where it was recommended."""
    bundle, codes = recommender.bundle, codes_of(7, len(bins))
    found = recommender.recommend_crops(
        codes, [rotation * WIDTH for rotation in bins], elevation_deg=elevation, followed=followed
    )
    share = None if elevation is None else elevation_weights(bundle.elevation_deg, elevation)
    now, after, more = brute_force(bundle, recommender.distributions(codes), bins, share)
    free = np.isfinite(found.error_after_deg)
    assert free.sum() == BINS - len(bins)
    if followed and len(bins) > 1:
        now += brute_force(bundle, recommender.distributions(codes)[:-1], bins[:-1], share)[2]
    assert found.expected_error_deg == pytest.approx(now, rel=1e-4)
    assert found.error_after_deg[free] == pytest.approx(after[free] + more, rel=1e-4)


def test_what_is_added_is_of_the_rotations_that_may_be_chosen(recommender):
    unlimited = []
    for seed, bins, allowed in ((7, (0,), [3, 9, 15]), (5, (0, 6), [2, 20]), (8, (0, -5), [4, 7])):
        codes, rotations = codes_of(seed, len(bins)), [rotation * WIDTH for rotation in bins]
        rows = recommender.distributions(codes)
        limits = np.isin(np.arange(BINS), allowed)
        _, after, more = brute_force(recommender.bundle, rows, bins, limits=limits)
        found = recommender.recommend_crops(codes, rotations, allowed_deg=np.array(allowed) * WIDTH)
        free = np.isfinite(found.error_after_deg)
        assert found.error_after_deg[free] == pytest.approx(after[free] + more, rel=1e-4)
        unlimited.append(brute_force(recommender.bundle, rows, bins)[2] - more)
    assert np.abs(unlimited).max() > 0.01


def test_a_frame_from_high_above_goes_by_turns_from_high_above(bundle):
    codes = codes_of(3, 1)
    for kept, elevation in ((0.0, -60.0), (30.0, 90.0)):
        of_it = np.flatnonzero(bundle.elevation_deg == kept)
        only = replace(
            bundle,
            distributions=bundle.distributions[of_it],
            elevation_deg=bundle.elevation_deg[of_it],
            sweep_weights=bundle.sweep_weights[of_it],
            object_ids=tuple(bundle.object_ids[place] for place in of_it),
        )
        wanted = Recommender(only).recommend_crops(codes)
        found = Recommender(bundle).recommend_crops(codes, elevation_deg=elevation)
        assert found.error_after_deg == pytest.approx(wanted.error_after_deg, rel=1e-4)
        assert found.expected_error_deg == pytest.approx(wanted.expected_error_deg, rel=1e-4)
        assert found.belief == pytest.approx(wanted.belief)


# Where the camera may go


def check_moves(found, rotations=(0.0,)):
    """The least error comes first, or the rotation that is farthest from all views so far."""
    moves = found.moves
    assert len(moves) <= 1 + N_ALTERNATIVES
    errors = [move.expected_error_deg for move in moves]
    assert errors[1:] == sorted(errors[1:])
    is_least = errors[0] == np.min(found.error_after_deg)
    if not is_least:
        free = np.isfinite(found.error_after_deg)
        apart = circular_distance_deg(HERE[:, None], np.array(rotations) - rotations[-1])
        own = circular_distance_deg(found.move.rotation_deg, np.array(rotations) - rotations[-1])
        assert own.min() == pytest.approx(apart.min(axis=1)[free].max(), abs=1e-5)
    for place, move in enumerate(moves):
        assert -180 < move.rotation_deg <= 180
        assert move.travel_deg == abs(move.rotation_deg) == travel_deg(move.rotation_deg)
        bin_ = round(move.rotation_deg / WIDTH) % BINS
        assert bin_ * WIDTH == pytest.approx(move.rotation_deg % 360)
        assert move.expected_error_deg == found.error_after_deg[bin_]
        # Each is the best of its neighbourhood.
        if place or is_least:
            assert move.expected_error_deg <= found.error_after_deg[(bin_ + 1) % BINS]
            assert move.expected_error_deg <= found.error_after_deg[bin_ - 1]
        for other in moves[:place]:
            assert circular_distance_deg(move.rotation_deg, other.rotation_deg) >= 15


@settings(max_examples=40)
@given(
    seed=seeds,
    # Nearer to a limit than this, rounding decides.
    rotations=st.lists(st.floats(-400, 400).map(lambda degrees: round(degrees, 3)), max_size=3),
    max_travel=st.floats(60, 180).map(lambda degrees: round(degrees, 3)),
)
def test_moves_keep_to_what_the_camera_may_do(recommender, seed, rotations, max_travel):
    rotations = [0.0, *rotations]
    codes = codes_of(seed, len(rotations))
    apart = circular_distance_deg(HERE[:, None], np.array(rotations) - rotations[-1]).min(axis=1)
    wanted = (apart >= MIN_SEPARATION_DEG) & (travel_deg(HERE) <= max_travel)
    if not (apart >= MIN_SEPARATION_DEG).any():
        assert recommender.recommend_crops(codes, rotations, max_travel_deg=max_travel).moves == ()
        return
    if not wanted.any():
        with pytest.raises(UserError, match="no admissible rotation"):
            recommender.recommend_crops(codes, rotations, max_travel_deg=max_travel)
        return
    found = recommender.recommend_crops(codes, rotations, max_travel_deg=max_travel)
    assert np.array_equal(np.isfinite(found.error_after_deg), wanted)
    check_moves(found, rotations)


def test_alternatives_are_of_other_neighbourhoods_where_bins_are_narrow(bundle):
    """Three degrees a bin, and errors, found at every second one, with many minima."""
    estimator = made_settings(120, hidden=40)
    rng = np.random.default_rng(0)
    rough = replace(
        bundle,
        estimator=estimator,
        network=bundled_model(random_estimator(estimator)),
        distributions=rng.dirichlet(np.full(120, 0.3), (2, 120)).astype(np.float32) + 1e-6,
        elevation_deg=np.zeros(2, np.float32),
        sweep_weights=np.ones(2, np.float32),
        object_ids=("a", "b"),
    )
    recommender = Recommender(rough)
    # What is added, by hand, of two rotations that may be chosen.
    (belief,) = recommender.distributions(codes_of(0, 1))
    views = after_rotations(rough.distributions, rough.object_ids)(())
    expected = expected_errors(views, belief, **rough.affinity, share=np.ones(2))
    parts, total = expected.by_object[:, [10, 25]], expected.total[[10, 25]]
    more = sum(own[np.argmin(total - own)] - own[np.argmin(total)] for own in parts)
    limited = recommender.recommend_crops(codes_of(0, 1), allowed_deg=[60.0, 150.0])
    wanted = expected.after_deg[[20, 50]] + more / expected.total[-1]
    assert limited.error_after_deg[[20, 50]] == pytest.approx(wanted, rel=1e-5)
    found = recommender.recommend_crops(codes_of(0, 2), [0.0, 60.0])
    minima = (found.error_after_deg < np.roll(found.error_after_deg, 1)) & (
        found.error_after_deg < np.roll(found.error_after_deg, -1)
    )
    assert minima.sum() > 15
    moves = found.moves
    assert len(moves) == 1 + N_ALTERNATIVES
    rotations = np.array([move.rotation_deg for move in moves])
    apart = circular_distance_deg(rotations[:, None], rotations)
    assert apart[~np.eye(len(moves), dtype=bool)].min() >= 15
    # After the first, each is the least error that is far enough from all before it.
    bins = 3.0 * np.arange(120)
    for place, move in enumerate(moves[1:], start=1):
        free = minima & (circular_distance_deg(bins[:, None], rotations[:place]).min(axis=1) >= 15)
        assert move.expected_error_deg == found.error_after_deg[free].min()


@given(seed=seeds, bins=st.lists(st.integers(-BINS, BINS), min_size=1, max_size=5))
def test_only_allowed_rotations_are_taken(recommender, seed, bins):
    allowed = [rotation * WIDTH for rotation in bins]
    wanted = {rotation % BINS for rotation in bins} - {0}
    codes = codes_of(seed, 1)
    if not wanted:
        with pytest.raises(UserError, match="no admissible rotation"):
            recommender.recommend_crops(codes, allowed_deg=allowed)
        return
    found = recommender.recommend_crops(codes, allowed_deg=allowed)
    assert set(np.flatnonzero(np.isfinite(found.error_after_deg))) == wanted
    check_moves(found)


@given(rotation=st.floats(-720, 720))
def test_an_allowed_rotation_is_answered_as_it_was_given(recommender, rotation):
    codes = codes_of(0, 1)
    if travel_deg(rotation) < MIN_SEPARATION_DEG:
        with pytest.raises(UserError, match="no admissible rotation"):
            recommender.recommend_crops(codes, allowed_deg=[rotation])
        return
    found = recommender.recommend_crops(codes, allowed_deg=[rotation])
    if -180 < rotation <= 180:
        assert found.move.rotation_deg == rotation
    assert -180 < found.move.rotation_deg <= 180
    assert circular_distance_deg(found.move.rotation_deg, rotation) < 1e-9
    assert found.move.travel_deg == abs(found.move.rotation_deg)
    assert found.alternatives == ()
    (bin_,) = np.flatnonzero(np.isfinite(found.error_after_deg))
    assert circular_distance_deg(bin_ * WIDTH, rotation) <= WIDTH / 2 + 1e-9
    # The expected error lies between those of the bins on either side, each the only one allowed.
    place = rotation % 360 / WIDTH
    bins = {int(at) % BINS for at in (np.floor(place), np.ceil(place))}
    if not bins & {0}:
        alone = [recommender.recommend_crops(codes, allowed_deg=[at * WIDTH]) for at in bins]
        sides = [answer.move.expected_error_deg for answer in alone]
        assert min(sides) - 1e-9 <= found.move.expected_error_deg <= max(sides) + 1e-9


def test_allowed_rotations_are_ranked(recommender):
    """Dense ones too: of neighbours within a bin the best, of all that are apart the order."""
    codes = codes_of(2, 1)
    allowed = np.arange(-180.0, 180.0, 2.5)
    found = recommender.recommend_crops(codes, allowed_deg=allowed)
    moves = found.moves
    assert all(move.rotation_deg in {*allowed, 180.0} for move in moves)
    free = recommender.recommend_crops(codes)
    least = [min(move.expected_error_deg for move in each.moves) for each in (found, free)]
    assert least[0] <= least[1]
    few = recommender.recommend_crops(codes, allowed_deg=[40.25, -75.5, 131.0])
    moves = few.moves
    assert {move.rotation_deg for move in moves} == {40.25, -75.5, 131.0}
    errors = [move.expected_error_deg for move in moves]
    assert errors == sorted(errors) or moves[0].rotation_deg == 131.0


@given(seed=seeds, mask=st.lists(st.booleans(), min_size=2, max_size=50))
def test_booleans_are_a_mask_over_the_circle(recommender, seed, mask):
    codes = codes_of(seed, 1)
    allowed = [360 * place / len(mask) for place, may in enumerate(mask) if may]
    if not any(travel_deg(rotation) >= MIN_SEPARATION_DEG for rotation in allowed):
        with pytest.raises(UserError, match="allowed"):
            recommender.recommend_crops(codes, allowed_deg=np.array(mask))
        return
    found = recommender.recommend_crops(codes, allowed_deg=np.array(mask))
    wanted = recommender.recommend_crops(codes, allowed_deg=allowed)
    assert found.moves == wanted.moves
    assert np.array_equal(found.error_after_deg, wanted.error_after_deg)


def test_allowed_rotations_count_from_the_last_frame(recommender):
    found = recommender.recommend_crops(codes_of(0, 2), [0.0, 90.0], allowed_deg=[90.0, -45.0])
    assert np.flatnonzero(np.isfinite(found.error_after_deg)).tolist() == [6, 21]
    # Back to the first frame is no new view.
    with pytest.raises(UserError, match="no admissible rotation"):
        recommender.recommend_crops(codes_of(0, 2), [0.0, 90.0], allowed_deg=[-90.0])


def test_where_nothing_is_allowed_is_one_line(recommender):
    codes = codes_of(0, 1)
    for options in (
        {"max_travel_deg": 14.9},
        {"max_travel_deg": 0.0},
        {"allowed_deg": [0.0]},
        {"allowed_deg": [5.0, -7.0, 360.0]},
        {"allowed_deg": [90.0], "max_travel_deg": 60.0},
    ):
        with pytest.raises(UserError, match="relax `allowed_deg` or `max_travel_deg`"):
            recommender.recommend_crops(codes, **options)


@pytest.mark.parametrize("options", [{}, {"allowed_deg": [90.0]}, {"max_travel_deg": 10.0}])
def test_frames_all_round_have_a_pose_and_no_next_view(recommender, options):
    everywhere = np.arange(BINS) * WIDTH
    codes = codes_of(0, BINS)
    found = recommender.recommend_crops(codes, everywhere, **options)
    assert found.move is None
    assert found.moves == found.alternatives == ()
    assert np.isinf(found.error_after_deg).all()
    # The pose is that of the same frames in another order, with room for a next view.
    half = recommender.recommend_crops(codes[:12], everywhere[:12])
    assert half.move is not None
    assert half.moves == (half.move, *half.alternatives)
    assert found.n_views == BINS
    logs = np.log(recommender.distributions(codes))
    product = np.exp(sum(np.roll(row, -place) for place, row in enumerate(logs)))
    back = np.roll(product / product.sum(), BINS - 1)
    assert found.belief == pytest.approx(back, abs=1e-6)


@pytest.mark.parametrize(
    ("n", "rotations", "message"),
    [
        (1, [0.0, 90.0], "1 frame and 2 rotations; give one for each frame"),
        (2, [0.0], "2 frames and 1 rotation; give one for each frame"),
        (1, "here", "'here' are not numbers"),
        (2, [10.0, 20.0], "the first is 10"),
        (2, [0.0, np.nan], "one is not finite, or beyond 1e6"),
        (2, [0.0, 1e300], "one is not finite, or beyond 1e6"),
    ],
)
def test_rotations_that_do_not_fit_the_frames_are_refused(recommender, n, rotations, message):
    with pytest.raises(UserError, match=message):
        recommender.recommend_crops(codes_of(0, n), rotations)
    with pytest.raises(UserError, match=message):
        recommender.recommend(FRAMES[:n], rotations_deg=rotations)


@pytest.mark.parametrize("rotations", [0, 0.0, np.float32(0), np.zeros(1), [0], (0.0,)])
def test_of_one_frame_the_rotation_may_be_a_number(recommender, rotations):
    same(
        recommender.recommend(FRAMES[0], rotations_deg=rotations), recommender.recommend(FRAMES[0])
    )
    codes = codes_of(0, 1)
    same(recommender.recommend_crops(codes, rotations), recommender.recommend_crops(codes))


@pytest.mark.parametrize(
    ("elevation", "is_told"),
    [(None, False), (-7.0, False), (15.0, False), (37.0, False), (-20.0, True), (70.0, True)],
)
def test_an_elevation_unlike_all_that_were_calibrated_is_told(recommender, elevation, is_told):
    """The bundle's are 0 and 30 degrees."""
    found = recommender.recommend_crops(codes_of(0, 1), elevation_deg=elevation)
    assert any("is outside the calibrated range of 0 to 30°" in w for w in found.warnings) == (
        is_told
    )


def test_an_elevation_is_a_number(recommender):
    with pytest.raises(UserError, match="`elevation_deg`=nan"):
        recommender.recommend_crops(codes_of(0, 1), elevation_deg=float("nan"))


# What is doubted


def test_where_no_turn_gives_agreement_the_sign_is_not_doubted():
    rng = np.random.default_rng(0)
    rows = np.full((2, BINS), 1e-6)
    rows[0, 3], rows[1, 9] = 1.0, 1.0
    bundle = Recommender.load("mug").bundle
    calibrated = after_rotations(rng.dirichlet(np.ones(BINS), (2, BINS)), ("a", "b"))
    for bins, words in ((4, "one is likely wrong"), (-6, "agree if rotated the other way")):
        answer = next_view(
            rows / rows.sum(axis=1, keepdims=True),
            [0.0, bins * WIDTH],
            calibrated,
            bundle.affinity,
        )
        assert words in answer.warnings[-1]


def test_where_calibration_knows_no_difference_the_opposite_view_is_recommended():
    """Distributions that say nothing: few rotations are surely better than another, by chance."""
    rng = np.random.default_rng(0)
    noise = rng.dirichlet(np.ones(BINS), (40, BINS))
    calibrated = after_rotations(noise, [str(i) for i in range(len(noise))])
    affinity = {"power": 16.0, "pseudo_observations": 90.0}
    moves = [next_view(row[None], [0.0], calibrated, affinity).move for row in noise[0]]
    assert np.mean([move.rotation_deg == 180.0 for move in moves]) > 0.8


def test_where_calibration_knows_a_better_one_that_is_recommended():
    """Two opposite views see nothing, and all others everything."""
    views = np.full((20, BINS, BINS), 1e-4)
    for view in range(BINS):
        views[:, view, view] = 1.0
    half = BINS // 4
    views[:, half] = views[:, half + BINS // 2] = 1.0
    views /= views.sum(axis=-1, keepdims=True)
    calibrated = after_rotations(views, [str(i) for i in range(len(views))])
    affinity = {"power": 16.0, "pseudo_observations": 1.0}
    answer = next_view(views[0, [half]], [0.0], calibrated, affinity)
    assert answer.move.rotation_deg != 180.0
    assert answer.move.expected_error_deg < answer.error_after_deg[BINS // 2] - 1.0


def test_a_turn_the_wrong_way_contradicts_the_frames():
    recommender = Recommender.load("mug")
    frames = [example_frame(azimuth_deg=azimuth).depth_m for azimuth in (75.0, 165.0)]
    intrinsics = example_frame().intrinsics
    right, wrong = (
        recommender.recommend(frames, rotations_deg=[0.0, rotation], intrinsics=intrinsics)
        for rotation in (90.0, -90.0)
    )
    assert right.bayes_factor > 0.5
    assert not right.warnings
    assert wrong.bayes_factor < 0.05
    (warning,) = wrong.warnings
    assert "contradict" in warning
    assert "agree if rotated the other way" in warning


# Out of distribution


def test_the_worst_ood_score_counts(recommender):
    codes = codes_of(11, 3)
    known = recommender.bundle.ood
    apart = ood_score(known, codes, recommender.network(codes))
    alone = [recommender.recommend_crops(codes[i : i + 1]).ood_score for i in range(3)]
    assert alone == pytest.approx(apart, rel=1e-5)
    together = recommender.recommend_crops(codes, [0.0, 60.0, 120.0])
    assert together.ood_score == pytest.approx(max(alone), rel=1e-5)
    assert together.is_ood == (together.ood_score > 1)


# Frames


def same(one, other):
    assert np.array_equal(np.stack(one.crops), np.stack(other.crops))
    assert np.array_equal(one.belief, other.belief)
    assert one.move == other.move
    assert one.azimuth_deg == other.azimuth_deg


def test_a_frame_may_be_given_in_many_forms(recommender):
    depth = FRAMES[0]
    wanted = recommender.recommend(depth)
    hole = np.where(depth > 0, depth, np.nan)
    for given_ in (
        [depth],
        (depth,),
        depth[None],
        depth.astype(np.float64),
        hole,
        np.where(depth > 0, depth, -1.0),
        depth[:, :, None],
        depth[None, None],
        depth[None, :, :, None],
        depth.tolist(),
        np.asfortranarray(depth),
    ):
        same(recommender.recommend(given_), wanted)
    assert np.isnan(hole).any()


def test_several_frames_may_be_a_list_or_an_array(recommender):
    rotations = [0.0, 60.0, -60.0]
    wanted = recommender.recommend(FRAMES[:3], rotations_deg=rotations)
    stack = np.stack(FRAMES[:3])
    for given_ in (stack, stack[:, None]):
        same(recommender.recommend(given_, rotations_deg=rotations), wanted)
    same(recommender.recommend(tuple(FRAMES[:3]), rotations_deg=np.array(rotations)), wanted)
    crops = np.stack([recommender.crop(depth).codes for depth in FRAMES[:3]])
    same(recommender.recommend_crops(crops, rotations), wanted)


def test_a_repeated_sequence_of_rotations_has_the_same_answer(bundle):
    """What calibration sweeps make of rotations is kept: no answer depends on those before it."""
    kept = Recommender(bundle)
    for rotations in ([0.0], [0.0, 60.0], [0.0, 90.0], [0.0, 60.0, 120.0], [0.0], [0.0, 60.0]):
        codes = codes_of(len(rotations), len(rotations))
        fresh = Recommender(bundle).recommend_crops(codes, rotations)
        found = kept.recommend_crops(codes, rotations)
        assert np.array_equal(found.error_after_deg, fresh.error_after_deg)
        same(found, fresh)


def test_without_intrinsics_the_bundle_has_a_focal_length(recommender):
    wanted = recommender.recommend(FRAMES[0])
    middle = COLUMNS / 2, ROWS / 2
    for intrinsics in ([FOCAL_PX], FOCAL_PX, int(FOCAL_PX)):
        same(recommender.recommend(FRAMES[0], intrinsics=intrinsics), wanted)
    # With a principal point the object is seen from where the camera is.
    in_view = recommender.recommend(FRAMES[0], intrinsics=(FOCAL_PX, FOCAL_PX, *middle))
    for intrinsics in (
        Intrinsics(FOCAL_PX, FOCAL_PX, *middle, COLUMNS, ROWS),
        np.array([[FOCAL_PX, 0, middle[0]], [0, FOCAL_PX, middle[1]], [0, 0, 1]]),
    ):
        same(recommender.recommend(FRAMES[0], intrinsics=intrinsics), in_view)
    apart = in_view.crops[0].astype(int) - wanted.crops[0]
    assert np.abs(apart).max() <= 1
    other = recommender.recommend(FRAMES[0], intrinsics=1.3 * FOCAL_PX)
    assert not np.array_equal(other.crops[0], wanted.crops[0])


@pytest.mark.parametrize("unit", [1000.0, 10_000.0, 4000.0, 0.001])
@pytest.mark.parametrize("surroundings", ["nothing", "wall", "mask"])
def test_a_wrong_unit_is_named_however_the_object_is_found(recommender, unit, surroundings):
    """What reaches as far as an object in metres is a sliver of it in millimetres."""
    depth, options = FRAMES[0], {}
    if surroundings == "mask":
        options["mask"] = depth > 0
    elif surroundings == "wall":
        depth = np.where(depth > 0, depth, 0.9).astype(np.float32)
    recommender.recommend(depth, **options)
    with pytest.raises(FrameError, match="multiply depths or `depth_scale`") as error:
        recommender.recommend(depth * np.float32(unit), **options)
    assert error.value.name == "implausible-distance"
    if surroundings == "mask" or unit != 4000.0:
        factors = str(error.value).partition("depths ")[2].partition(" times")[0].split(" or ")
        assert f"{1 / unit:g}" in factors


def test_a_bad_frame_is_refused_by_its_name_where_it_has_one(recommender):
    bad = np.zeros_like(FRAMES[0])
    with pytest.raises(FrameError, match=r"^empty-mask: left: the frame has no depth"):
        recommender.recommend(bad, names=["left"])
    with pytest.raises(FrameError, match=r"^empty-mask: right: the frame has no depth"):
        recommender.recommend([FRAMES[0], bad], rotations_deg=[0, 90], names=["left", "right"])
    with pytest.raises(UserError, match=r"^`max_travel_deg`=-1"):
        recommender.recommend(FRAMES[0], names=["left"], max_travel_deg=-1.0)
    with pytest.raises(UserError, match=r"^`far_m`=900: give metres"):
        recommender.recommend(FRAMES[0], names=["left"], far_m=900.0)
    with pytest.raises(UserError, match="1 frame and 2 names"):
        recommender.recommend(FRAMES[0], names=["left", "right"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"depth_m": "frame.npy"},
            "depth: 'frame.npy' is text; give an array, such as that of nbv.read_depth",
        ),
        ({"near_m": "1"}, "`near_m`: '1' is not a number"),
        ({"far_m": 10**400}, "`far_m`: the number is too large"),
    ],
)
def test_an_argument_of_another_type_is_one_line(recommender, options, message):
    with pytest.raises(UserError, match=message):
        recommender.recommend(**{"depth_m": FRAMES[0]} | options)


def test_a_recommender_is_of_a_bundle(bundle):
    for name in (3, None):
        with pytest.raises(UserError, match=f"{name} is not a file name"):
            Recommender.load(name)
    with pytest.raises(UserError, match="'mug' is not a Bundle; give its name or file to Recommen"):
        Recommender("mug")


def test_crops_are_bytes(recommender):
    codes = recommender.crop(FRAMES[0]).codes
    for wrong in ("crop", codes, codes[None] / 255):
        with pytest.raises(UserError, match=r"`codes`: .*; give \(n, side, side\) uint8"):
            recommender.recommend_crops(wrong)


def test_masks_are_as_many_as_frames(recommender):
    mask = FRAMES[0] > 0
    with pytest.raises(UserError, match="2 frames and 1 mask:"):
        recommender.recommend(FRAMES[:2], rotations_deg=[0.0, 90.0], mask=mask)
    with pytest.raises(UserError, match="1 frame and 2 masks"):
        recommender.recommend(FRAMES[0], mask=[mask, mask])
    with pytest.raises(UserError, match="the mask has"):
        recommender.recommend(FRAMES[0], mask=mask.T)


def test_each_frame_may_have_a_camera_of_its_own(recommender):
    one, other = (Intrinsics(f, f, 60.0, 45.0) for f in (FOCAL_PX, 1.2 * FOCAL_PX))
    rotations = [0.0, 60.0]
    found = recommender.recommend(FRAMES[:2], rotations_deg=rotations, intrinsics=[one, other])
    crops = [
        recommender.crop(depth, intrinsics=camera).codes
        for depth, camera in zip(FRAMES[:2], (one, other), strict=True)
    ]
    same(found, recommender.recommend_crops(np.stack(crops), rotations))
    with pytest.raises(UserError, match="2 frames and 3 cameras"):
        recommender.recommend(FRAMES[:2], rotations_deg=rotations, intrinsics=[one] * 3)


def test_distributions_are_those_of_the_logits(recommender):
    codes = codes_of(5, 4)
    logits = recommender.network(codes)
    wanted = from_logits(logits, recommender.bundle.temperature)
    assert np.array_equal(recommender.distributions(codes), wanted)
    belief = recommender.recommend_crops(codes[:1]).belief
    assert belief == pytest.approx(wanted[0], rel=1e-4)


def test_an_object_that_is_not_upright_gets_a_warning():
    """Of the views that are rotated more than of the upright ones, and by how much."""
    recommender = Recommender.load("mug")
    told = {0: 0, 1: 0, 2: 0}
    for azimuth_deg in range(0, 360, 90):
        for quarters, elevation_deg in ((0, 15.0), (0, 30.0), (1, 15.0), (2, 30.0)):
            drawn = draw_frame(example_mesh(), azimuth_deg, elevation_deg, 0.8, 0.17)
            answer = recommender.recommend(np.rot90(drawn.depth_m, quarters), intrinsics=(585.0,))
            what = f"rotate the frame by {90 * quarters}°" if quarters else "up is up"
            told[quarters] += any(what in warning for warning in answer.warnings)
    assert told[0] == 0
    assert min(told[1], told[2]) >= 2


def test_a_unit_that_shows_a_more_usual_size_is_told():
    """In tenths of a millimetre the mug and a board 0.3 m behind it look like one small object."""
    recommender = Recommender.load("mug")
    drawn = draw_frame(example_mesh(), 0.0, 15.0, 2.5, 0.17, sensor="none")
    right = drawn.depth_m.copy()
    board = right[140:340, 260:380]
    board[board == 0] = 2.8
    told = {}
    for unit in (1.0, 0.1):
        crop = recommender.crop(right * np.float32(unit), intrinsics=drawn.intrinsics)
        told[unit] = [doubt for doubt in crop.doubts if "times as large" in doubt]
    assert told[1.0] == []
    assert len(told[0.1]) == 1
    assert "depths 10 times as large it would be 0.1" in told[0.1][0]
