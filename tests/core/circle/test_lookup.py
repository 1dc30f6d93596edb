import numpy as np
import pytest

from made_estimates import evidence_of, hidden_range_estimates
from nbv.choice.rotations import ranked_rotations
from nbv.core.circle import lookup
from nbv.errors import UserError
from nbv.files import read_arrays, write_arrays
from nbv.tables.lookup import LookupTable, build_lookup


def test_ties_go_to_the_smallest_travel_and_then_to_the_smaller_delta():
    flat = np.zeros((2, 8), dtype=np.float32)
    assert lookup.least_cost_delta(flat).tolist() == [0, 0]
    flat[:, 0] = 1
    assert lookup.least_cost_delta(flat).tolist() == [45, 45]  # not 315
    flat[0, 1] = 1
    assert lookup.least_cost_delta(flat).tolist() == [315, 45]


@pytest.mark.parametrize("travel_cost", [0.0, 1.0])
def test_a_cost_that_is_not_a_number_is_never_the_least(travel_cost):
    cost = np.ones((2, 8))
    cost[1, 3] = np.nan
    with pytest.raises(UserError, match="cost is NaN"):
        lookup.least_cost_delta(cost, travel_cost=travel_cost)


def test_a_stored_table_comes_back_whole(tmp_path):
    table = build_lookup(evidence_of(hidden_range_estimates(4), 8, 10, 36), "pose_ambiguity")
    table.save(tmp_path / "pose_ambiguity.npz")
    read = LookupTable.load(tmp_path / "pose_ambiguity.npz")
    for name, value in vars(table).items():
        np.testing.assert_array_equal(getattr(read, name), value)
    assert read.cost.dtype == np.float32


def test_recommendations_are_read_at_the_nearest_bin():
    table = build_lookup(evidence_of(hidden_range_estimates(4), 8, 10, 360), "pose_ambiguity")
    for rotations in (table.recommend, table.least_cost):
        assert rotations([359.6, 0.2, 89.5]).tolist() == [
            table.recommended_delta_deg[k] for k in (0, 0, 90)
        ]


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300, "123", None])
def test_an_estimate_that_is_no_number_has_no_rotation(bad):
    table = build_lookup(evidence_of(hidden_range_estimates(4), 8, 10, 36), "pose_ambiguity")
    for rotations in (table.recommend, table.least_cost):
        for estimate in (bad, [0.0, bad]):
            with pytest.raises(UserError, match="not a finite number"):
                rotations(estimate)


@pytest.mark.parametrize("n_bins", [8, 72, 360])
def test_a_view_from_the_same_place_is_not_recommended(rng, n_bins):
    """A table whose costs are least at hand, or a bin next to it, as those of one object may be."""
    cost = rng.uniform(1, 2, (n_bins, n_bins)).astype(np.float32)
    width = 360 / n_bins
    near = np.arange(n_bins) % 5
    for row in np.flatnonzero(near < 3):
        cost[row, (0, 1, -1)[near[row]]] = 0
    deltas = lookup.least_cost_delta(cost)
    rows = np.full((n_bins, n_bins), 1 / n_bins, np.float32)
    table = LookupTable(rows, rows, cost, deltas, 8, 3, "given_estimate", "entropy", "made")
    every = np.arange(n_bins) * width
    assert table.least_cost(every).tolist() == deltas.tolist()
    found = table.recommend(every)
    travel = np.minimum(found, 360 - found)
    assert travel.min() > width
    chosen = cost[np.arange(n_bins), np.rint(found / width).astype(int)]
    assert np.array_equal(chosen, cost[:, 2:-1].min(axis=1))
    kept = near >= 3
    free = np.minimum(deltas, 360 - deltas) > width
    assert np.array_equal(found[kept & free], deltas[kept & free])


def test_travel_that_costs_is_avoided_and_limits_are_kept():
    rng = np.random.default_rng(0)
    table = rng.uniform(0, 1, (50, 72))
    travel = np.minimum(np.arange(72) * 5, 360 - np.arange(72) * 5)
    for cost in (0.0, 0.002, 0.05):
        chosen = lookup.least_cost_delta(table, travel_cost=cost)
        expected = (table + cost * travel).min(axis=1)
        bins = chosen // 5
        reached = table[np.arange(50), bins] + cost * travel[bins]
        np.testing.assert_allclose(reached, expected)
    near = lookup.least_cost_delta(table, max_travel_deg=60) // 5
    assert travel[near].max() <= 60
    within = np.where(travel <= 60, table, np.inf)
    np.testing.assert_array_equal(table[np.arange(50), near], within.min(axis=1))
    assert (lookup.least_cost_delta(table, max_travel_deg=0) == 0).all()


@pytest.mark.parametrize(("max_travel_deg", "travel_cost"), [(30.0, 0.0), (180.0, 0.1), (20, 0.02)])
def test_the_next_view_obeys_the_limits_of_its_table(rng, tmp_path, max_travel_deg, travel_cost):
    """Rows that stay, too, also after the table was stored."""
    cost = rng.uniform(1, 2, (36, 36)).astype(np.float32)
    cost[::2, 0] = 0
    limits = {"travel_cost": travel_cost, "max_travel_deg": max_travel_deg}
    deltas = lookup.least_cost_delta(cost, **limits)
    assert (deltas == 0).sum() >= 18
    rows = np.full((36, 36), 1 / 36, np.float32)
    names = "given_estimate", "entropy", "pose_ambiguity"
    LookupTable(rows, rows, cost, deltas, 8, 3, *names, **limits).save(tmp_path / "t.npz")
    table = LookupTable.load(tmp_path / "t.npz")
    rotations = np.arange(36) * 10
    travel = np.minimum(rotations, 360 - rotations)
    may = (travel > 10) & (travel <= max_travel_deg)
    total = np.where(may, cost + travel_cost * travel, np.inf)
    assert table.recommend(rotations).tolist() == rotations[total.argmin(axis=1)].tolist()
    for estimate, row in enumerate(total):
        (best, found), *_ = ranked_rotations(table, estimate * 10.0)[0]
        assert best % 360 == rotations[row.argmin()]
        assert found == pytest.approx(cost[estimate, row.argmin()])


def test_a_rotation_is_15_degrees_or_more_where_one_may_be(rng):
    cost = rng.uniform(1, 2, (120, 120)).astype(np.float32)
    cost[:, [2, 3, 117, 118]] = 0  # 6 and 9 degrees
    rows, limits = np.full((120, 120), 1 / 120, np.float32), {"travel_cost": 0.0}
    deltas = lookup.least_cost_delta(cost, travel_cost=0.0, max_travel_deg=180.0)
    names = "given_estimate", "entropy", "pose_ambiguity"
    table = LookupTable(rows, rows, cost, deltas, 8, 3, *names, **limits)
    for estimate in range(0, 360, 30):
        assert min(abs(rotation) for rotation, _ in ranked_rotations(table, estimate)[0]) >= 15
        near = ranked_rotations(table, estimate, max_travel_deg=10.0)[0]
        assert {abs(rotation) for rotation, _ in near} <= {6.0, 9.0}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("viewpoint_likelihood", np.full((36, 36), 1.1 / 36)),
        ("cost", None),
        ("cost", (np.s_[1, 2], np.nan)),
        ("cost", (np.s_[:, 5], 4.0)),  # above log 36
        ("cost", np.zeros((36, 36), dtype=bool)),
        ("cost", np.zeros((36, 35), dtype=np.float32)),
        ("recommended_delta_deg", (np.s_[:1], 360)),
        ("recommended_delta_deg", (np.s_[3:4], 170)),
        ("criterion", np.array("best")),
        ("spread", np.array("width")),
        ("pose_likelihood", np.array(3)),
        ("bandwidth_deg", np.array(np.nan)),
        ("pseudo_observations", np.array(-1.0)),
        ("max_travel_deg", np.array("far")),
        ("travel_cost", np.array(np.inf)),
    ],
    ids=str,
)
def test_a_table_that_cannot_be_is_refused(tmp_path, name, value):
    path = tmp_path / "pose_ambiguity.npz"
    table = build_lookup(evidence_of(hidden_range_estimates(4), 8, 10, 36), "pose_ambiguity")
    table.save(path)
    arrays = read_arrays(path)
    if value is None:
        del arrays[name]
    elif isinstance(value, tuple):
        arrays[name][value[0]] = value[1]
    else:
        arrays[name] = value
    write_arrays(path, arrays)
    with pytest.raises(UserError, match=r"pose_ambiguity\.npz: .*; make it again with nbv calib"):
        LookupTable.load(path)


@pytest.mark.parametrize("pseudo_observations", [1, 1000])
@pytest.mark.parametrize("criterion", ["pose_ambiguity", "information_gain", "expected_error"])
def test_a_table_that_knows_nothing_is_told_from_one_that_is_cautious(
    rng, criterion, pseudo_observations
):
    """With many pseudo-observations all entropies are near that of a guess."""
    for estimates, is_guess in (
        (hidden_range_estimates(8), False),
        (rng.uniform(0, 360, (8, 360)), True),
        (np.tile(rng.normal(100, 5, 360), (8, 1)), True),
    ):
        evidence = evidence_of(estimates, 8, pseudo_observations, 36)
        _, warnings = ranked_rotations(build_lookup(evidence, criterion), 90.0)
        assert any("a guess" in warning for warning in warnings) == is_guess


def test_a_table_without_limits_has_none(tmp_path):
    table = build_lookup(evidence_of(hidden_range_estimates(4), 8, 10, 36), "pose_ambiguity")
    table.save(tmp_path / "t.npz")
    arrays = read_arrays(tmp_path / "t.npz")
    del arrays["travel_cost"], arrays["max_travel_deg"]
    write_arrays(tmp_path / "t.npz", arrays)
    loaded = LookupTable.load(tmp_path / "t.npz")
    assert (loaded.travel_cost, loaded.max_travel_deg) == (0, 180)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("no.npz", None, "no.npz does not exist; name the file that nbv calibrate wrote"),
        ("cut.npz", b"PK\x03\x04", "it is not an .npz file, or only a part of one"),
        ("one.npy", b"", "one.npy: cannot be read "),
    ],
)
def test_a_file_that_is_no_table_is_to_be_made_with_the_program(tmp_path, name, content, message):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(UserError, match="nbv calibrate") as error:
        LookupTable.load(tmp_path / name)
    assert message in str(error.value)
