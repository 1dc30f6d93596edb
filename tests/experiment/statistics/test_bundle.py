"""What a run says of a bundle: means and intervals over objects, whatever their sweeps."""

import re

import numpy as np
import pandas as pd
import pytest

from nbv.experiment.statistics.bundle import bundle_lines

VIEWS = (("single", 1), ("random", 2), ("opposite", 2), ("recommended", 2), ("recommended", 3))


def numbers_of(folder, errors_deg):
    """Mean, low and high end in each row; `errors_deg` is (objects, sweeps, views)."""
    rows = [
        {"object_id": f"{name:02}", "choice": choice, "n_views": n, "mae_deg": sweeps[i][place]}
        for name, sweeps in enumerate(errors_deg)
        for i in range(len(sweeps))
        for place, (choice, n) in enumerate(VIEWS)
    ]
    pd.DataFrame(rows).sample(frac=1, random_state=1).to_csv(folder / "cup.csv", index=False)
    lines = bundle_lines(folder / "cup.safetensors")
    assert str(folder / "cup.safetensors") in lines[0]
    assert f"{len(errors_deg)} test object" in lines[1]
    assert f"nbv recommend FRAME --bundle {folder / 'cup.safetensors'}" in lines[-1]
    return np.array([re.findall(r"\d+\.\d", line) for line in lines[2:-1]], dtype=float)


def test_equal_objects_leave_nothing_to_chance(tmp_path):
    errors = np.tile([8.0, 5.0, 3.0, 2.0, 1.0], (6, 2, 1))
    assert numbers_of(tmp_path, errors) == pytest.approx(np.tile([[8.0], [5.0], [3.0], [2.0]], 3))


def test_an_interval_is_over_objects_and_not_over_sweeps(tmp_path):
    """Sweeps of an object count together: as often as not makes no difference."""
    of_object = np.random.default_rng(0).gamma(4.0, 2.0, (40, 1, len(VIEWS)))
    found = numbers_of(tmp_path, of_object)
    assert (numbers_of(tmp_path, of_object.repeat(5, axis=1)) == found).all()
    means = of_object[:, 0, :4].mean(axis=0)
    spread = of_object[:, 0, :4].std(axis=0) / np.sqrt(40)
    assert found[:, 0] == pytest.approx(means, abs=0.06)
    assert found[:, 2] - found[:, 1] == pytest.approx(2 * 1.96 * spread, rel=0.15)
