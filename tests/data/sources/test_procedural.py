"""Objects made from the seed, as a source."""

import numpy as np

from mesh_files import refused, source_of
from nbv.data.sources import select_objects
from nbv.data.sources.procedural import CATEGORIES


def test_its_categories_are_the_generators():
    from nbv.data import procedural

    assert set(CATEGORIES) == set(procedural.CATEGORIES)


def test_objects_are_the_first_so_many_and_the_exclusions_skipped():
    assert select_objects(source_of("procedural"), "mug", 3) == [
        *("mug-0000", "mug-0001", "mug-0002")
    ]
    source = source_of("procedural", exclude=["mug-0001"])
    assert select_objects(source, "mug", 2) == ["mug-0000", "mug-0002"]


def test_an_object_depends_on_seed_and_number():
    one = source_of("procedural", seed=0).load("mug", "mug-0001")
    same = source_of("procedural", seed=0).load("mug", "mug-0001")
    other = source_of("procedural", seed=1).load("mug", "mug-0001")
    assert np.array_equal(one.vertices, same.vertices)
    assert not np.array_equal(one.vertices, other.vertices)
    assert np.isclose(np.linalg.norm(np.ptp(one.vertices, axis=0)), 1.0)


def test_the_setting_of_handles_reaches_the_generator():
    plain, far = (source_of("procedural", handle_reach=reach) for reach in (0, 0.5))
    width, length, _ = np.ptp(far.load("mug", "mug-0000").vertices, axis=0)
    assert length / width >= 1.5
    width, length, _ = np.ptp(plain.load("mug", "mug-0000").vertices, axis=0)
    assert length / width < 1.5


def test_the_share_of_square_mugs_reaches_the_generator():
    plain, square = (source_of("procedural", square_share=share) for share in (0, 1))
    # Away from the handle, towards a corner.
    to_corner = [
        each.load("mug", "mug-0000").vertices[:, :2].sum(axis=1).max() for each in (plain, square)
    ]
    assert to_corner[1] > 1.05 * to_corner[0]


def test_what_it_cannot_make_is_refused():
    source = source_of("procedural")
    refused(lambda: source.object_ids("mugg"), "no category mugg", "did you mean 'mug'")
    refused(lambda: select_objects(source, "mug", None), "set n_objects")
