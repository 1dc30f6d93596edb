from __future__ import annotations

import math

from nbv.evaluation.runtime import RUNTIME_COLUMNS, load_runtime


def test_jobs_are_summed_by_rule(tree):
    runtime = load_runtime(tree).set_index("rule")
    assert list(runtime.index) == ["train", "split"]
    assert runtime.loc["train", "jobs"] == 3
    assert runtime.loc["train", "cpu_s"] == 3 * 33.25
    assert runtime.loc["train", "wall_s"] == 3 * 34.5
    assert runtime.loc["train", "max_rss_mb"] == 812.25


def test_jobs_too_short_to_measure_have_no_memory(tree):
    split = load_runtime(tree).set_index("rule").loc["split"]
    assert (split["jobs"], split["wall_s"]) == (1, 0.2)
    assert math.isnan(split["max_rss_mb"])


def test_no_benchmarks_is_an_empty_table(tmp_path):
    runtime = load_runtime(tmp_path)
    assert runtime.empty
    assert tuple(runtime.columns) == RUNTIME_COLUMNS
