"""How long a run takes on a cluster, computed from what a run measured."""

from __future__ import annotations

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from performance.cluster import (
    REFERENCE,
    Costs,
    Size,
    costs,
    critical_path_s,
    load_measured,
    main,
    makespan_s,
    work_s,
)

SECONDS = st.floats(0.1, 500)
SIZES = st.builds(Size, st.integers(1, 8), st.integers(1, 6), st.integers(1, 5))
COSTS = st.builds(Costs, data_s=SECONDS, fold_s=SECONDS, report_s=SECONDS, notice_s=SECONDS)


def test_the_papers_own_run_comes_out_as_measured():
    """Ten units on two cores: five mugs' elevations more than one of each, so two a category."""
    measured_s = pd.read_csv(REFERENCE).set_index("rule").loc["all", "elapsed_s"]
    size = Size(categories=5, elevations=2, folds=5)
    cost = costs(size, load_measured(REFERENCE), start_s=0, notice_s=0)
    assert makespan_s(size, cost, cores=2) == pytest.approx(measured_s, rel=0.05)


@given(SIZES, COSTS, st.integers(1, 200))
def test_no_number_of_cores_beats_the_critical_path_or_the_work(size, cost, cores):
    found_s = makespan_s(size, cost, cores)
    assert found_s >= critical_path_s(cost) * (1 - 1e-9)
    assert found_s >= work_s(size, cost) / cores * (1 - 1e-9)


@given(SIZES, COSTS)
def test_with_a_core_for_every_job_the_critical_path_is_all(size, cost):
    cores = size.units * size.folds
    assert makespan_s(size, cost, cores) == pytest.approx(critical_path_s(cost))


def test_one_core_does_all_the_work_one_after_the_other():
    size = Size(categories=3, elevations=2, folds=5)
    cost = Costs(data_s=10, fold_s=60, report_s=20, notice_s=0)
    assert makespan_s(size, cost, cores=1) == pytest.approx(3 * 10 + 30 * 60 + 20)


def test_the_command_prints_a_line_for_each_number_of_nodes(capsys):
    main(["--nodes", "1", "7", "--cores", "4"])
    printed = capsys.readouterr().out
    assert "330 units" in printed
    assert "1 nodes of 4 cores" in printed
    assert "7 nodes of 4 cores" in printed
