import os
from itertools import pairwise

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.experiment.report.runtime import (
    JOB_COLUMNS,
    PAUSE_S,
    RUNTIME_COLUMNS,
    TOTAL_ROW,
    efficiency,
    load_jobs,
    runtime_table,
    summarise_jobs,
)
from nbv.experiment.report.table import table_markdown

HEADER = "s\th:m:s\tmax_rss\tmax_vms\tmax_uss\tmax_pss\tio_in\tio_out\tmean_load\tcpu_time\n"
START_S = 1_700_000_000.0


def job_files(root):
    """(rule, benchmark, log) of every job that left a benchmark, as the workflow names them."""
    for path in sorted((root / "benchmarks").rglob("*.tsv")):
        name = path.relative_to(root / "benchmarks").with_suffix("")
        yield name.parts[0], path, root / "logs" / name.with_suffix(".log")


def load_runtime(root):
    return summarise_jobs(load_jobs(job_files(root)))


def runtime_markdown(root):
    return table_markdown(runtime_table(load_jobs(job_files(root))))


def add_job(root, job, start_s, wall_s, cpu_s, rss_mib, told_s=None):
    """Write what Snakemake leaves of one job; `told_s` is what the job's log says at its end."""
    path = root / "benchmarks" / f"{job}.tsv"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"{HEADER}{wall_s}\t0:00:00\t{rss_mib}\t1\t1\t1\t0\t0\t50\t{cpu_s}\n")
    os.utime(path, (START_S + start_s + wall_s,) * 2)
    if told_s is not None:
        log = root / "logs" / f"{job}.log"
        log.parent.mkdir(parents=True, exist_ok=True)
        log.write_text(f"[10:00:00 a b] epoch 1\n[10:00:09 a b] processor time {told_s:.2f} s\n")


@pytest.fixture
def root(tmp_path):
    """Two lanes: a training and two renders at the same time, then a table."""
    add_job(tmp_path, "train/mug/el00/fold1", 0, 50.0, 15.25, 800.0)
    add_job(tmp_path, "render/mug/el00", 0, 10.0, 9.5, 150.0)
    add_job(tmp_path, "render/mug/el30", 10, 30.0, 25.5, 160.5)
    add_job(tmp_path, "settings", 50, 0.5, "NA", "NA")
    return tmp_path


def test_sums_by_rule(root):
    runtime = load_runtime(root).set_index("rule")
    assert list(runtime.index) == ["train", "render", "settings", TOTAL_ROW]
    render = runtime.loc["render"]
    assert (render["jobs"], render["cpu_s"], render["wall_s"]) == (2, 35.0, 40.0)
    assert (render["median_s"], render["max_s"], render["peak_mib"]) == (20.0, 30.0, 160.5)
    settings = runtime.loc["settings"]
    assert (settings["jobs"], settings["cpu_s"], settings["wall_s"]) == (1, 0.0, 0.5)
    assert pd.isna(settings["peak_mib"])


def test_the_total_is_of_all_jobs(root):
    runtime = load_runtime(root)
    total = runtime.iloc[-1]
    assert (total["jobs"], total["cpu_s"], total["wall_s"]) == (4, 50.25, 90.5)
    assert (total["median_s"], total["max_s"], total["peak_mib"]) == (20.0, 50.0, 800.0)
    assert total["elapsed_s"] == pytest.approx(50.5, abs=1e-4)
    assert total["side_by_side"] == 2
    assert efficiency(runtime) == pytest.approx(50.25 / (2 * 50.5), abs=1e-4)
    assert runtime["elapsed_s"].notna().sum() == 1


def test_the_larger_of_what_was_sampled_and_what_the_job_told(root):
    add_job(root, "train/mug/el00/fold1", 0, 50.0, 15.25, 800.0, told_s=48.75)
    add_job(root, "train/mug/el00/fold2", 50, 5.0, 4.5, 800.0, told_s=4.25)
    assert list(load_jobs(job_files(root))["cpu_s"]) == [9.5, 25.5, 0.0, 48.75, 4.5]
    (root / "benchmarks/train/mug/el00/fold2.tsv").unlink()
    runtime = load_runtime(root).set_index("rule")
    assert runtime.loc[TOTAL_ROW, "cpu_s"] == 83.75
    assert list(runtime["sampled_jobs"]) == [0, 2, 1, 3]
    assert "Processor times of 3 jobs are Snakemake's samples" in runtime_markdown(root)


def test_only_the_jobs_that_are_named_count(root):
    before = load_runtime(root)
    files = list(job_files(root))
    add_job(root, "train/car/el00/fold1", 60, 5.0, 5.0, 100.0)
    pd.testing.assert_frame_equal(summarise_jobs(load_jobs(files)), before)
    assert load_runtime(root).iloc[-1]["jobs"] == 5


def test_a_job_that_was_not_timed_is_passed_over(root):
    before = load_runtime(root)
    absent = ("train", root / "benchmarks/train/absent.tsv", root / "logs/train/absent.log")
    after = summarise_jobs(load_jobs([*job_files(root), absent]))
    pd.testing.assert_frame_equal(after, before)


def test_the_rule_is_told_and_not_read_from_the_path(root):
    files = [("other", *paths) for _, *paths in job_files(root)]
    assert list(summarise_jobs(load_jobs(files))["rule"]) == ["other", TOTAL_ROW]


def test_a_long_pause_is_no_part_of_the_run(root):
    add_job(root, "table/table1", 50.5 + PAUSE_S - 1, 1.0, 1.0, 90.0)
    assert load_runtime(root).iloc[-1]["elapsed_s"] == pytest.approx(50.5 + PAUSE_S, abs=1e-4)
    add_job(root, "table/table1", 90_000.0, 1.0, 1.0, 90.0)
    assert load_runtime(root).iloc[-1]["elapsed_s"] == pytest.approx(51.5, abs=1e-4)


@given(
    st.lists(
        st.tuples(st.integers(0, 400), st.integers(1, 50), st.floats(0, 60)),
        min_size=1,
        max_size=12,
    )
)
def test_elapsed_and_concurrency_by_brute_force(jobs):
    frame = pd.DataFrame(
        [("train", cpu, True, float(wall), 1.0, float(start + wall)) for start, wall, cpu in jobs],
        columns=list(JOB_COLUMNS),
    )
    total = summarise_jobs(frame).iloc[-1]
    # Second by second: how many jobs run, and the gaps between those that do.
    running = [sum(start <= t < start + wall for start, wall, _ in jobs) for t in range(460)]
    busy = [t for t in range(460) if running[t]]
    pauses = [b - a - 1 for a, b in pairwise(busy) if b - a - 1 > PAUSE_S]
    assert total["elapsed_s"] == pytest.approx(busy[-1] + 1 - busy[0] - sum(pauses))
    assert total["side_by_side"] == max(running)
    assert total["cpu_s"] == pytest.approx(sum(cpu for *_, cpu in jobs))


def test_the_page_for_people(root, tmp_path):
    text = runtime_markdown(root)
    assert "| train | 1 | 15.2 | 50.0 | 50.0 | 50.0 | 800 |" in text
    assert "| settings | 1 | 0.0 | 0.5 | 0.5 | 0.5 | – |" in text
    assert "| all | 4 | 50.2 | 90.5 | 20.0 | 50.0 | 800 |" in text
    assert "50 s" in text
    assert "At most 2 jobs" in text
    assert "at least 50 %" in text
    assert "nan" not in text


def test_nothing_is_called_a_sample_where_every_job_told_its_time(tmp_path):
    add_job(tmp_path, "claims", 0, 4000.0, 1.0, 90.0, told_s=4000.0)
    text = runtime_markdown(tmp_path)
    assert "Processor times are Snakemake's samples" not in text
    assert "at least" not in text
    assert "1 h 7 min" in text
    assert "1 job ran at once" in text


def test_no_benchmarks_is_an_empty_table(tmp_path):
    runtime = load_runtime(tmp_path)
    assert runtime.empty
    assert tuple(runtime.columns) == RUNTIME_COLUMNS
    assert tuple(load_jobs([]).columns) == JOB_COLUMNS
    assert "No job was timed" in runtime_markdown(tmp_path)
