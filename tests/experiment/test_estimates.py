import numpy as np
import pytest
from scipy.special import log_softmax

from nbv.core.circle.estimates import Estimates, posteriors_of
from nbv.errors import UserError
from nbv.experiment.estimates import (
    read_estimates,
    read_posteriors,
    write_estimates,
    write_posteriors,
)
from nbv.files import read_arrays, write_arrays


def random_logits(seed: int, shape: tuple[int, ...]) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, 2, shape)


def test_estimates_come_back_to_four_decimals(tmp_path):
    rng = np.random.default_rng(0)
    estimate = rng.uniform(0, 360, (3, 360))
    estimate[0, 0] = 359.99999  # would be printed as 360.0
    write_estimates(tmp_path / "e.csv", Estimates(("null", "NA", "007"), estimate))
    header = (tmp_path / "e.csv").read_text().splitlines()[0]
    assert header == "object_id,azimuth_deg,estimate_deg"
    read = read_estimates(tmp_path / "e.csv")
    assert read.object_ids == ("null", "NA", "007")
    assert read.estimate_deg[0, 0] == 0.0
    np.testing.assert_allclose(read.estimate_deg.ravel()[1:], estimate.ravel()[1:], atol=5.1e-5)
    np.testing.assert_array_equal(read.azimuth_deg, np.arange(360))


def test_a_missing_view_is_refused(tmp_path):
    path = tmp_path / "e.csv"
    write_estimates(path, Estimates(("a",), np.zeros((1, 360))))
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:50] + lines[51:]) + "\n")
    with pytest.raises(UserError, match="full sweep"):
        read_estimates(path)


@pytest.mark.parametrize("value", ["", "nan", "inf", "-0.1", "360.0", "1e300", "abc"])
def test_an_estimate_that_is_no_azimuth_is_refused(tmp_path, value):
    path = tmp_path / "e.csv"
    write_estimates(path, Estimates(("a", "b"), np.full((2, 4), 7.5)))
    lines = path.read_text().splitlines()
    lines[3] = f"a,2,{value}"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(UserError, match=r"e\.csv: .*; delete the file"):
        read_estimates(path)


def test_further_columns_of_older_files_are_ignored(tmp_path):
    path = tmp_path / "e.csv"
    write_estimates(path, Estimates(("a",), np.full((1, 4), 7.0)))
    header, *rows = path.read_text().splitlines()
    older = [f"{header},concentration", *(f"{row},0.5" for row in rows)]
    path.write_text("\n".join(older) + "\n")
    np.testing.assert_array_equal(read_estimates(path).estimate_deg, np.full((1, 4), 7.0))


def test_posteriors_come_back_with_their_temperature(tmp_path):
    logits = random_logits(3, (2, 5, 24))
    made = posteriors_of(["007", "NA"], logits, 1.7)
    write_posteriors(tmp_path / "p.npz", made)
    read = read_posteriors(tmp_path / "p.npz", ["007", "NA"])
    assert (read.object_ids, read.temperature) == (("007", "NA"), 1.7)
    np.testing.assert_allclose(read.log_posterior, log_softmax(logits / 1.7, axis=-1), atol=1e-5)
    with pytest.raises(UserError, match=r"p\.npz: its objects differ"):
        read_posteriors(tmp_path / "p.npz", ["NA", "007"])


@pytest.mark.parametrize("name", ["log_posterior", "temperature", "object_ids"])
def test_damaged_posteriors_are_refused(tmp_path, name):
    path = tmp_path / "p.npz"
    made = posteriors_of(["a", "b"], random_logits(3, (2, 5, 24)), 1.7)
    write_posteriors(path, made)
    whole = read_arrays(path)
    wrong = {
        "log_posterior": [whole["log_posterior"] + 0.1, whole["log_posterior"] * np.nan],
        "temperature": [np.array(0.0), np.array(np.nan), np.array([1.0, 2.0])],
        "object_ids": [whole["object_ids"][:1]],
    }
    for array in wrong[name]:
        write_arrays(path, whole | {name: array})
        with pytest.raises(UserError, match=r"p\.npz: "):
            read_posteriors(path, ["a", "b"])
    write_arrays(path, {key: array for key, array in whole.items() if key != name})
    with pytest.raises(UserError, match=rf"p\.npz: holds no array '{name}'"):
        read_posteriors(path, ["a", "b"])
