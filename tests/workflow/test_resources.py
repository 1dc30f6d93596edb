"""What a cluster is asked for: memory and time of each job, and which jobs go together."""

from __future__ import annotations

import re

import pytest
import yaml

from projects import ROOT, STUDIES, TINY

pytestmark = pytest.mark.slow


def asked(project, attempt: int) -> dict[str, tuple[int, int]]:
    """Return the memory in MB and the minutes that each rule asks for at that attempt."""
    targets = (*STUDIES, "report", "leaderboard", "more_views", "travel", "ablation")
    dry = ("--cores", "2", "--dry-run", "--quiet", "host", "--attempt", str(attempt))
    printed = project.run(*targets, *dry).stdout
    found = {}
    for rule, line in re.findall(r"^rule (\w+):\n(?: .*\n)*? +resources: (.*)$", printed, re.M):
        resources = dict(re.findall(r"(mem_mb|runtime)=(\d+)", line))
        found[rule] = (int(resources["mem_mb"]), int(resources["runtime"]))
    return found


def test_every_rule_asks_for_memory_and_time_and_for_more_when_it_is_tried_again(fresh):
    first, third = asked(fresh, 1), asked(fresh, 3)
    assert {"settings", "meshes", "render", "train", "lookup", "report", "ablation"} <= set(first)
    assert first == {rule: (mb // 3, minutes // 3) for rule, (mb, minutes) in third.items()}
    assert min(mb for mb, _ in first.values()) >= 1000


def test_the_slurm_profile_groups_every_rule_of_the_paper_and_no_other_name(fresh):
    profile = yaml.safe_load((ROOT / "profiles/slurm/config.yaml").read_text("utf-8"))
    grouped = set(profile["groups"])
    rules: set[str] = set()
    for estimator in ((), ("estimator=linear", "camera.image_side=64")):
        printed = fresh.run(*STUDIES, "--list-rules", overrides=(*TINY, *estimator)).stdout
        rules |= set(printed.split())
        assert set(fresh.would_run(*estimator)) <= grouped
    assert grouped <= rules
