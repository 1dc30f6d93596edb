"""What a cluster is asked for: memory and time of each job, and which jobs go together."""

import re

import pytest
import yaml

from projects import ROOT, STUDIES

pytestmark = pytest.mark.slow


PROFILE = yaml.safe_load((ROOT / "profiles/slurm/config.yaml").read_text("utf-8"))
GROUPED = set(PROFILE["groups"])


def test_every_rule_asks_for_memory_and_time_in_proportion_to_the_attempt(fresh):
    """The profile for SLURM groups those of one unit's folds, and all others of the paper."""
    # No rule's memory or time at its first attempt is a multiple of this prime.
    attempt = 17
    studies = ("leaderboard", "more_views", "travel", "ablation")
    dry = ("--cores", "2", "--dry-run", "--quiet", "host", "--attempt", str(attempt))
    printed = fresh.run(*STUDIES, "report", *studies, *dry).stdout
    rules = set()
    for rule, line in re.findall(r"^rule (\w+):\n(?: .*\n)*? +resources: (.*)$", printed, re.M):
        resources = dict(re.findall(r"(mem_mb|runtime)=(\d+)", line))
        mb, minutes = int(resources["mem_mb"]), int(resources["runtime"])
        assert mb % attempt == minutes % attempt == 0, rule
        assert mb >= attempt * 1000, rule
        rules.add(rule)
    assert {"settings", "meshes", "render", "train", "lookup", "report", "ablation"} <= rules
    assert rules - GROUPED == {"evaluate_ablation", *studies}


def test_the_slurm_profile_groups_the_rules_of_linear_estimators_and_no_other_name(fresh):
    linear = ("estimator=linear", "camera.image_side=64")
    assert set(fresh.would_run(*linear)) <= GROUPED
    sources = [path.read_text("utf-8") for path in ROOT.glob("*/rules/*.smk")]
    named = re.findall(r"^ *(?:rule|use rule .* as) (\w+)", "\n".join(sources), re.MULTILINE)
    assert set(named) >= GROUPED
