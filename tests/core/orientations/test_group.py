"""Rotations modulo the symmetry of an object, against enumeration."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nbv.core.orientations.group import ASYMMETRIC, Symmetry, along_ray, spiral, viewing_direction
from nbv.errors import UserError
from nbv.numbers import as_orientations


def bop(*rotations):
    """Rotation vectors in degrees, as the matrices of ``symmetries_discrete``."""
    matrices = np.tile(np.eye(4), (len(rotations), 1, 1))
    matrices[:, :3, :3] = Rotation.from_rotvec(np.array(rotations), degrees=True).as_matrix()
    matrices[:, :3, 3] = [5, -3, 2]  # where a model's origin is does not matter
    return [matrix.ravel().tolist() for matrix in matrices]


def freely(axis):
    return [{"axis": axis, "offset": [0, 0, 4]}]


SYMMETRIES = {
    "none": {"diameter": 63.5},
    "half turn": {"symmetries_discrete": bop([0, 180, 0])},
    "quarter turns, of a generator": {"symmetries_discrete": bop([0, 0, 90])},
    "cube": {"symmetries_discrete": bop([0, 0, 90], [90, 0, 0])},
    "cone": {"symmetries_continuous": freely([0, 2, 0])},
    "oblique cone": {"symmetries_continuous": freely([1, 2, -1])},
    "cylinder": {
        "symmetries_continuous": freely([0, 0, 1]),
        "symmetries_discrete": bop([180, 0, 0], [0, 0, 180]),
    },
}
ORDER = {"none": 1, "half turn": 2, "quarter turns, of a generator": 4, "cube": 24}
EVERY = pytest.mark.parametrize("name", SYMMETRIES)


def elements(name):
    """The group, every quarter of a degree where it turns freely."""
    symmetry = Symmetry.from_bop(SYMMETRIES[name])
    if symmetry.axis is None:
        return symmetry.discrete
    steps = np.radians(np.arange(0, 360, 0.25))[:, None] * symmetry.axis
    rotations = Rotation.from_rotvec(steps).as_matrix()
    return np.concatenate([g @ rotations for g in symmetry.discrete])


def some(n, seed=0):
    return Rotation.random(n, rng=np.random.default_rng(seed)).as_matrix()


def relabelled(rotations, name, seed=0):
    group = elements(name)
    chosen = np.random.default_rng(seed).integers(len(group), size=len(rotations))
    return rotations @ group[chosen]


@pytest.mark.parametrize(("name", "order"), ORDER.items())
def test_a_group_is_closed(name, order):
    group = Symmetry.from_bop(SYMMETRIES[name]).discrete
    assert len(group) == order
    products = (group[:, None] @ group).reshape(-1, 9)
    nearest = np.abs(products[:, None] - group.reshape(-1, 9)).max(axis=2).min(axis=1)
    assert nearest.max() < 1e-9


@EVERY
def test_distances_are_the_smallest_over_the_group(name):
    symmetry, a, b = Symmetry.from_bop(SYMMETRIES[name]), some(5), some(4, 1)
    equivalent = b[:, None] @ elements(name)
    angle = Rotation.from_matrix((a.mT[:, None, None] @ equivalent).reshape(-1, 3, 3)).magnitude()
    brute = np.degrees(angle).reshape(5, 4, -1).min(axis=2)
    np.testing.assert_allclose(symmetry.distance_deg(a[:, None], b), brute, atol=0.13)
    np.testing.assert_allclose(np.degrees(np.arccos(symmetry.cosine(a, b))), brute, atol=0.13)
    seen = viewing_direction(equivalent)
    closest = np.einsum("ni,mgi->nmg", viewing_direction(a), seen).max(axis=2)
    cosine = symmetry.direction_cosine(viewing_direction(a), viewing_direction(b))
    np.testing.assert_allclose(cosine, closest, atol=1e-5)
    towards = viewing_direction(b @ symmetry.towards(viewing_direction(a[:4]), b))
    expected = np.diagonal(closest)
    np.testing.assert_allclose((towards * viewing_direction(a[:4])).sum(1), expected, atol=1e-5)


@EVERY
def test_relabelling_changes_no_distance_mean_or_canonical_pose(name):
    symmetry, a, b = Symmetry.from_bop(SYMMETRIES[name]), some(6), some(6, 1)
    c, d = relabelled(a, name), relabelled(b, name, 1)
    distance = symmetry.distance_deg(a, b)
    np.testing.assert_allclose(symmetry.distance_deg(c, d), distance, atol=1e-6)
    np.testing.assert_allclose(symmetry.distance_deg(a, c), 0, atol=1e-6)
    np.testing.assert_allclose(symmetry.canonical(c), symmetry.canonical(a), atol=1e-9)
    for one, other, there, back in zip(a, b, c, d, strict=True):
        mean = symmetry.mean(np.stack([one, other]))
        again = symmetry.mean(np.stack([there, back]))
        assert symmetry.distance_deg(mean, again) < 1e-5
        # The middle of the shortest way.
        half = symmetry.distance_deg(one, other) / 2
        assert symmetry.distance_deg(mean, one) == pytest.approx(half, abs=1e-5)
        assert symmetry.distance_deg(mean, other) == pytest.approx(half, abs=1e-5)


def test_poses_half_a_turn_apart_have_the_first_as_their_mean():
    first = some(1)[0]
    opposite = first @ Rotation.from_rotvec([0, np.pi, 0]).as_matrix()
    np.testing.assert_array_equal(ASYMMETRIC.mean(np.stack([first, opposite])), first)


def test_the_spiral_is_about_even():
    nearest = np.degrees(np.arccos(ASYMMETRIC.cosine(some(300), spiral(4608)))).min(axis=1)
    assert 6 < nearest.mean() < 9
    assert nearest.max() < 15


def test_a_camera_that_looks_straight_sees_the_object_on_its_axis():
    position = np.array([[100.0, -250.0, 700.0], [0.0, 0.0, 1.0]])
    rotations = along_ray(position)
    seen = (rotations @ position[..., None])[..., 0]
    np.testing.assert_allclose(
        seen, np.linalg.norm(position, axis=1)[:, None] * [0, 0, 1], atol=1e-9
    )
    np.testing.assert_allclose(as_orientations(rotations, "rotations")[1], np.eye(3))


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"symmetries_discrete": [[1, 0, 0]]}, "16 numbers"),
        ({"symmetries_discrete": [np.diag([-1, 1, 1, 1]).ravel()]}, "a reflection"),
        ({"symmetries_discrete": [np.diag([2, 1, 1, 1]).ravel()]}, "perpendicular unit vectors"),
        ({"symmetries_discrete": bop([0, 0, 1])}, "more than 60 rotations"),
        ({"symmetries_continuous": freely([0, 0, 0])}, "without three numbers"),
        ({"symmetries_continuous": freely([0, 0, 1]) + freely([1, 0, 0])}, "more than one axis"),
        (
            {"symmetries_continuous": freely([0, 0, 1]), "symmetries_discrete": bop([90, 0, 0])},
            "moves the axis",
        ),
    ],
)
def test_an_impossible_symmetry_is_refused(entry, message):
    with pytest.raises(UserError, match=message):
        Symmetry.from_bop(entry)


@pytest.mark.parametrize(
    ("rotations", "message"),
    [
        ([np.eye(3), -np.eye(3)], r"R\[1\] is a reflection"),
        ([np.eye(3), np.full((3, 3), np.nan)], r"R\[1\] is not a rotation"),
        (1000 * np.eye(3), "R is not a rotation"),
        (np.eye(4), r"\(4, 4\) instead of"),
        ([["x"] * 3] * 3, "not a number"),
    ],
)
def test_what_is_no_rotation_is_named(rotations, message):
    with pytest.raises(UserError, match=message):
        as_orientations(rotations, "R")


DIRECTION = np.array([0, 1, (1 + 5**0.5) / 2]) / np.sqrt((5 + 5**0.5) / 2)
FINITE = {
    3: [[0, 0, 120]],
    12: [[0, 0, 60], [180, 0, 0]],
    24: [[0, 0, 90], [90, 0, 0]],
    59: [[0, 0, 360 / 59]],
    60: [72 * DIRECTION, 120 * np.ones(3) / np.sqrt(3)],
}


@pytest.mark.parametrize("order", FINITE)
@pytest.mark.parametrize("decimals", [3, 4, 6, 15])
def test_rounded_symmetries_form_the_group_that_they_mean(order, decimals):
    n_read = 0
    for tilt in some(20):
        vectors = np.array(FINITE[order]) @ tilt.T
        rounded = np.round(bop(*vectors), decimals).tolist()
        try:
            as_orientations(np.reshape(rounded, (-1, 4, 4))[:, :3, :3], "R")
        except UserError:
            continue  # too coarse to be a rotation
        group, n_read = Symmetry.from_bop({"symmetries_discrete": rounded}).discrete, n_read + 1
        assert len(group) == order
        exact = Symmetry.from_bop({"symmetries_discrete": bop(*vectors)}).discrete
        assert np.degrees(np.arccos(ASYMMETRIC.cosine(group, exact))).min(axis=1).max() < 0.7
    assert n_read


def test_a_turn_that_is_no_part_of_a_whole_one_is_no_symmetry():
    with pytest.raises(UserError, match="more than 60 rotations"):
        Symmetry.from_bop({"symmetries_discrete": bop([0, 0, 119.5])})


def test_one_symmetry_need_be_no_list_and_may_be_there_twice():
    (axis,) = freely([0, 2, 0])
    for axes in (axis, [axis, axis]):
        assert Symmetry.from_bop({"symmetries_continuous": axes}).axis.tolist() == [0, 1, 0]
    matrix = np.diag([-1.0, -1, 1, 1])
    for given in (matrix.tolist(), matrix.ravel().tolist(), [matrix.tolist()]):
        assert len(Symmetry.from_bop({"symmetries_discrete": given}).discrete) == 2


@pytest.mark.parametrize(
    "key", ["symmetry_discrete", "Symmetries_continuous", "symetries_discrete", "discrete"]
)
def test_a_misspelt_key_is_named(key):
    with pytest.raises(UserError, match=f"'{key}' is no key of BOP: give symmetries_discrete"):
        Symmetry.from_bop({"diameter": 1, key: []})
