"""The workflow from another folder: by its path, and as a module of another Snakefile."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from projects import TINY, Project

pytestmark = pytest.mark.slow

MODULE = """
configfile: "config/config.yaml"

rule mine:
    input: "results/tiny/splits/mug.csv"
    default_target: True

module nbv:
    snakefile: {source}
    config: {{"experiment": "small", "overrides": {overrides}}}

use rule * from nbv as nbv_*
"""


def elsewhere(project: Project, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "snakemake", "--cores", "2", *arguments]
    return subprocess.run(
        command, cwd=folder, env=project.environment, capture_output=True, text=True
    )


def write_module(folder: Path, source: str) -> None:
    """Write a Snakefile with a configuration of its own, which has none of the project's keys."""
    (folder / "config").mkdir()
    (folder / "config/config.yaml").write_text("mine: 3\n")
    (folder / "Snakefile").write_text(MODULE.format(source=source, overrides=list(TINY)))


@pytest.mark.parametrize(
    ("targets", "last"),
    [
        ([], "default"),
        (["results/paper/evaluation/mug/el00/fold3/proposed.csv"], "evaluate"),
    ],
)
def test_a_run_is_planned_from_elsewhere_with_the_projects_profile(fresh, tmp_path, targets, last):
    snakefile = str(fresh.folder / "workflow/Snakefile")
    done = elsewhere(fresh, tmp_path, "--snakefile", snakefile, *targets, "--dry-run")
    assert done.returncode == 0, done.stderr
    assert f"{fresh.folder}/workflow/profiles/default" in done.stderr
    jobs = re.findall(r"^(\w+) +\d+$", done.stdout, re.MULTILINE)
    assert jobs[-2:] == [last, "total"]


@pytest.mark.parametrize("snakefile", ["Snakefile", "workflow/Snakefile"])
def test_another_snakefile_uses_the_workflow_as_a_module(fresh, tmp_path, snakefile):
    write_module(tmp_path, repr(str(fresh.folder / snakefile)))
    done = elsewhere(fresh, tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "results/tiny/splits/mug.csv").is_file()
    assert not (tmp_path / "results/tiny/depth").exists()
    assert not fresh.results.exists()


def test_a_module_without_its_folder_on_disk_is_one_line(fresh, tmp_path):
    git = ["git", "-C", str(fresh.folder), "-c", "user.name=a", "-c", "user.email=a@b"]
    for command in (["init"], ["add", "Snakefile", "workflow"], ["commit", "--message", "all"]):
        subprocess.run([*git, *command], check=True, capture_output=True)
    source = f"gitfile({str(fresh.folder)!r}, path='workflow/Snakefile', commit='HEAD')"
    write_module(tmp_path, source)
    done = elsewhere(fresh, tmp_path)
    assert done.returncode != 0
    assert done.stderr.splitlines()[-1].startswith("nbv: error: the folder config")
    assert "Traceback" not in done.stderr
