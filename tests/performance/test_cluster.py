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
    main,
    makespan_s,
    reference_size,
    work_s,
)

from nbv.experiment.config import read_configuration
from nbv.experiment.report.runtime import load_measured

SECONDS = st.floats(0.1, 500)
SIZES = st.builds(
    Size,
    st.lists(st.integers(1, 6), min_size=1, max_size=8).map(tuple),
    st.integers(1, 5),
)
COSTS = st.builds(Costs, *[SECONDS] * 7)


def of_reference(name: str) -> tuple[Size, Costs, pd.Series]:
    """Size and costs of a reference run, and the line of its whole."""
    reference = REFERENCE.parent / name
    configuration = read_configuration(reference)
    measured = load_measured(reference / "runtime.csv")
    size = reference_size(configuration)
    cost = costs(size, measured, configuration, start_s=0, notice_s=0)
    return size, cost, pd.read_csv(reference / "runtime.csv").set_index("rule").loc["all"]


def test_the_papers_own_run_takes_as_long_as_measured():
    size, cost, whole = of_reference("paper")
    assert makespan_s(size, cost, cores=2) == pytest.approx(whole["elapsed_s"], rel=0.05)


# In the runs with real meshes and real mugs, estimates had jobs of their own.
@pytest.mark.parametrize("name", ["paper", "real-meshes", "real-mugs"])
def test_the_work_of_a_reference_run_is_that_of_its_jobs(name):
    size, cost, whole = of_reference(name)
    assert work_s(size, cost) == pytest.approx(whole["wall_s"], rel=0.001)


@given(SIZES, COSTS, st.integers(1, 200))
def test_no_number_of_cores_beats_the_critical_path_or_the_work(size, cost, cores):
    found_s = makespan_s(size, cost, cores)
    assert found_s >= critical_path_s(size, cost) * (1 - 1e-9)
    assert found_s >= work_s(size, cost) / cores * (1 - 1e-9)


@given(SIZES, COSTS)
def test_with_a_core_for_every_job_the_critical_path_is_all(size, cost):
    assert makespan_s(size, cost, size.jobs) == pytest.approx(critical_path_s(size, cost))


def test_one_core_does_all_the_work_one_after_the_other():
    size = Size(elevations=(2, 2, 1), folds=5)
    cost = Costs(0, category_s=4, elevation_s=3, lowest_s=60, next_s=20, report_s=20, notice_s=0)
    work = 3 * 4 + 5 * 3 + 15 * 60 + 10 * 20 + 20
    assert makespan_s(size, cost, cores=1) == pytest.approx(work)


def test_the_command_prints_a_line_for_each_number_of_nodes(capsys):
    main(["--nodes", "1", "7", "--cores", "4"])
    printed = capsys.readouterr().out
    assert "330 units, 331 jobs" in printed
    assert "1 nodes of 4 cores" in printed
    assert "7 nodes of 4 cores" in printed
