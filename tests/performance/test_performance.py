import json
import os
import time

import numpy as np
import pandas as pd
import pytest
from performance.__main__ import BENCHMARKS, main
from performance.figures import Figure, Target, summary_line, table_line
from performance.timing import Times, median_ratio, take_turns
from performance.workflow import linear_estimators, shared_work, utilisation

from nbv.experiment.report.runtime import load_jobs, summarise_jobs
from nbv.files import write_csv


def test_a_quick_run_writes_a_list_of_figures(tmp_path, capsys):
    path = tmp_path / "bench.json"
    main(["--quick", "--only", "evaluation", "--only", "lookup", "--output", str(path)])
    figures = json.loads(path.read_text())
    assert [figure["name"].split()[0] for figure in figures] == ["evaluation", "lookup"]
    for figure in figures:
        assert list(figure) == sorted(["name", "ratio", "target", "reached", "detail"])
        assert figure["ratio"] > 0
        assert figure["reached"] is None or isinstance(figure["reached"], bool)
        assert figure["name"] in capsys.readouterr().out or figure is not figures[0]


def test_a_part_does_not_take_the_place_of_the_whole(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    main(["--only", "workflow"])
    assert [path.name for path in tmp_path.rglob("*.json")] == ["bench-partial.json"]


def test_an_unknown_name_is_refused_with_those_there_are(capsys):
    with pytest.raises(SystemExit):
        main(["--only", "rendring"])
    message = capsys.readouterr().err
    assert all(name in message for name in BENCHMARKS)


def test_the_ratio_is_the_median_of_neighbours_not_the_ratio_of_medians():
    # The machine was ten times slower in the second and third round, for both alike.
    times = Times(np.array([[2.0, 1.0], [20.0, 10.0], [20.0, 10.0], [2.0, 1.0], [9.0, 1.0]]))
    assert times.ratio(0, 1) == 2.0
    assert median_ratio([2, 20, 9], [1, 10, 1]) == 2.0


def test_works_take_turns():
    calls = []
    times = take_turns([lambda: calls.append("a"), lambda: calls.append("b")], 3)
    assert "".join(calls) == "ab" * 4
    assert times.rounds.shape == (3, 2)
    assert (times.rounds > 0).all()
    calls.clear()
    take_turns([lambda: calls.append("a"), lambda: calls.append("b")], 2, False, in_a_row=3)
    assert "".join(calls) == "aaabbb" * 2


def test_of_calls_in_a_row_the_median_counts(monkeypatch):
    clock = iter([1.0, 9.0, 2.0, 5.0, 5.0, 50.0])
    monkeypatch.setattr("performance.timing.seconds", lambda work: next(clock))
    times = take_turns([lambda: None, lambda: None], 1, False, in_a_row=3)
    assert times.rounds.tolist() == [[2.0, 5.0]]


def test_time_is_measured_in_seconds():
    times = take_turns([lambda: time.sleep(0.02), lambda: time.sleep(0.01)], 2, warm_up=False)
    assert (times.rounds.min(axis=0) >= [0.02, 0.01]).all()


@pytest.mark.parametrize(
    ("target", "ratio", "reached"),
    [
        (Target(0.9), 0.9, True),
        (Target(0.9), 0.89, False),
        (Target(1.3, at_most=True), 1.3, True),
        (Target(1.3, at_most=True), 1.31, False),
        (Target(3.0), None, None),
        (None, 3.0, None),
    ],
)
def test_targets_hold_from_their_own_side(target, ratio, reached):
    figure = Figure("what", ratio, target, "how")
    assert figure.reached is reached
    assert ("MISSED" in table_line(figure)) is (reached is False)


def test_what_was_not_measured_counts_neither_way():
    figures = [
        Figure("a", 5.0, Target(3), ""),
        Figure("b", 1.0, Target(3), ""),
        Figure("c", None, Target(3), "skipped"),
        Figure("d", 1.0, None, ""),
    ]
    assert summary_line(figures) == "1 of 2 targets reached"


def job(results, name, start, seconds, cpu_time, told=None):
    """Write what a job leaves, and the table of all jobs so far."""
    tsv = results / "benchmarks" / f"{name}.tsv"
    log = results / "logs" / f"{name}.log"
    for path in (tsv, log):
        path.parent.mkdir(parents=True, exist_ok=True)
    tsv.write_text(f"s\th:m:s\tmax_rss\tcpu_time\n{seconds}\t0:00:00\t1.0\t{cpu_time}\n")
    log.write_text("" if told is None else f"[12:00:00 train] processor time {told:.1f} s\n")
    os.utime(tsv, (start + seconds, start + seconds))
    jobs = [
        ("train", path, results / f"logs/train/{path.stem}.log") for path in results.rglob("*.tsv")
    ]
    write_csv(results / "tables/runtime.csv", summarise_jobs(load_jobs(jobs)))


def test_utilisation_is_the_jobs_processor_time_over_the_cores_time(tmp_path):
    job(tmp_path, "train/a", 1000, 50, 15, told=48)
    job(tmp_path, "train/b", 1000, 30, 15, told=30)
    job(tmp_path, "train/c", 1030, 20, 9, told=19)
    figure = utilisation(tmp_path)
    assert figure.ratio == pytest.approx((48 + 30 + 19) / (2 * 50))
    assert figure.reached is True
    (tmp_path / "tables/runtime.csv").unlink()
    assert utilisation(tmp_path).ratio is None


def test_incomplete_processor_times_are_no_verdict_unless_they_suffice(tmp_path):
    job(tmp_path, "train/a", 1000, 40, 15)
    job(tmp_path, "train/b", 1000, 40, 15, told=39)
    figure = utilisation(tmp_path)
    assert figure.reached is None
    assert figure.detail.startswith("at least 0.68: processor times of 1 jobs are incomplete")
    job(tmp_path, "train/a", 1000, 40, 39)
    assert utilisation(tmp_path).reached is True


def test_linear_estimators_are_compared_with_networks_by_time_and_error(tmp_path):
    columns = ["rule", "cpu_s"]
    for name, rows, error_deg in (
        ("quick", [("extract", 30), ("fit", 10), ("render", 15), ("lookup", 5), ("all", 80)], 4.0),
        ("paper", [("train", 400), ("all", 500)], 8.0),
    ):
        tables = tmp_path / name / "tables"
        tables.mkdir(parents=True)
        write_csv(tables / "runtime.csv", pd.DataFrame(rows, columns=columns))
        cells = [("single", "mae", error_deg), ("single", "pauc", 1.0), ("random", "mae", 1.0)]
        write_csv(tables / "table1.csv", pd.DataFrame(cells, columns=["method", "metric", "value"]))
    assert shared_work(tmp_path / "quick").ratio == 80 / 20
    figures = linear_estimators(tmp_path / "quick", tmp_path / "paper")
    assert [figure.ratio for figure in figures] == [40 / 400, 4.0 / 8.0]
    assert [f.ratio for f in linear_estimators(tmp_path / "none", tmp_path / "paper")] == [None] * 2


def test_a_run_that_never_was_has_no_figure(tmp_path):
    assert utilisation(tmp_path / "paper").detail.startswith("not run")
