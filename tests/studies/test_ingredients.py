"""What ingredients bring is a difference over objects and trainings."""

import numpy as np
import pandas as pd
import pytest
from studies.ingredients import ALL, ingredient_table
from studies.trainings import crossed_mean

from nbv.bundles.evaluation import RECOMMENDED, SINGLE


def training(errors_deg: np.ndarray) -> pd.DataFrame:
    """One training's errors, (n_objects, 2) in one view and two, each object in two recordings."""
    rows = []
    for name, (one, two) in enumerate(errors_deg):
        for sequence, more in (("low", -1.0), ("high", 1.0)):
            rows.append((f"mug-{name}", sequence, SINGLE, 1, one + more))
            rows.append((f"mug-{name}", sequence, RECOMMENDED, 2, two + more))
            rows.append((f"mug-{name}", sequence, "random", 2, 90.0))
    columns = ["object_id", "sequence", "choice", "n_views", "mae_deg"]
    # In another order in each training.
    return pd.DataFrame(rows, columns=columns).sample(
        frac=1.0, random_state=int(1e3 * errors_deg[0, 0])
    )


@pytest.fixture
def errors(rng) -> dict[str, np.ndarray]:
    """By what is left out: (n_trainings, n_objects, 2)."""
    return {name: rng.uniform(5.0, 20.0, (3, 6, 2)) for name in (ALL, "lost_depth")}


def table_of(errors, real=None):
    given, of_real = (
        {("mug", name): [training(one) for one in each] for name, each in (some or {}).items()}
        for some in (errors, real)
    )
    return ingredient_table(given, of_real)


def test_a_line_is_the_difference_to_the_first_over_objects_and_trainings(errors):
    cells = table_of(errors).cells
    assert cells["without"].tolist() == ["nothing", "lost_depth"]
    for views, key in enumerate(("one_view", "two_views")):
        with_all, without = (errors[name][..., views] for name in (ALL, "lost_depth"))
        found = crossed_mean(without - with_all).interval()
        assert cells[key].tolist() == pytest.approx([with_all.mean(), found.value])
        assert cells[f"{key}_low"][1] == pytest.approx(found.low)
        assert cells[f"{key}_high"][1] == pytest.approx(found.high)


def test_real_recordings_have_the_least_and_greatest_training(errors, rng):
    real = {name: rng.uniform(5.0, 20.0, (3, 1, 2)) for name in errors}
    table = table_of(errors, real)
    for line, name in enumerate(errors):
        of_training = real[name][:, 0, 0]
        row = table.cells.iloc[line]
        assert row["one_view_real"] == pytest.approx(of_training.mean())
        assert row["one_view_real_least"] == pytest.approx(of_training.min())
        assert row["one_view_real_greatest"] == pytest.approx(of_training.max())
        least, greatest = f"{of_training.min():.2f}", f"{of_training.max():.2f}"
        assert table.rows[line][3].text.endswith(f"({least} to {greatest})")


def test_one_training_has_no_range_and_says_so(errors, rng):
    real = {name: rng.uniform(5.0, 20.0, (1, 1, 2)) for name in errors}
    table = table_of({name: each[:1] for name, each in errors.items()}, real)
    assert table.rows[0][3].text == f"{real[ALL][0, 0, 0]:.2f}°"
    assert "one training each" in table.notes[0]
    assert "3 trainings" in table_of(errors).notes[0]
