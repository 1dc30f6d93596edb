"""What the targets of the Makefile do, without doing it."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from nbv.experiment.config import load_config

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not here")
def test_the_package_ships_the_bundles_that_make_bundles_made_and_no_others():
    command = ["make", "--dry-run", "bundles"]
    shown = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    shown = shown.replace("\\\n", " ")
    (made,) = re.findall(r"snakemake .* bundles --config (.+)", shown)
    settings = load_config(ROOT / "config", made.split())
    (copied,) = re.findall(r"^cp (.+) src/nbv/bundles/shipped/$", shown, re.MULTILINE)
    assert copied.split() == [
        f"results/{settings['name']}/bundles/{category}.safetensors"
        for category in settings["categories"]
    ]


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not here")
@pytest.mark.parametrize(
    ("target", "says"), [("quick", "paper.*four minutes"), ("reproduce", "paper.*20 to 45 minutes")]
)
def test_the_first_make_says_what_it_does_and_how_long_that_usually_takes(tmp_path, target, says):
    command = ["make", "--dry-run", "--always-make", target, f"VENV={tmp_path / 'venv'}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    order = ["echo.*environment.*two minutes", "-m venv", f"echo.*{says}", "snakemake"]
    places = [re.search(words, done.stdout) for words in order]
    assert all(places)
    starts = [place.start() for place in places]
    assert starts == sorted(starts)
