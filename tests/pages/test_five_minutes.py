"""docs/five-minutes.md: its commands print what it shows, and draw the picture that it shows."""

import re
import runpy
import shlex
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from nbv.cli import main

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs/five-minutes.md").read_text("utf-8")
TERMINAL = TEXT.split("source nbv-env/bin/activate")[1].split("```python")[0]
SHOWN = re.findall(r"^    (.+)$", TERMINAL, re.MULTILINE)
COMMANDS = [line for line in SHOWN if line.startswith("nbv ")]
ANSWERS = [line for line in SHOWN if line not in COMMANDS]
DECIMAL = r"\d+\.\d+"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("five_minutes")


@pytest.fixture(scope="module")
def printed(folder) -> list[str]:
    """What the commands print, run one after another in an empty folder."""
    with chdir(folder), redirect_stdout(StringIO()) as lines:
        for command in COMMANDS:
            assert main(shlex.split(command)[1:]) == 0, command
    return lines.getvalue().splitlines()


def test_the_commands_print_what_the_page_shows(printed):
    """To one unit of the last decimal: another processor may round otherwise."""
    assert len(COMMANDS) == 4
    assert [re.sub(DECIMAL, "#", line) for line in printed] == [
        re.sub(DECIMAL, "#", line) for line in ANSWERS
    ]
    found, shown = (
        [float(number) for number in re.findall(DECIMAL, "\n".join(lines))]
        for lines in (printed, ANSWERS)
    )
    assert found == pytest.approx(shown, abs=0.11)


def test_the_text_follows_the_answer():
    """The second frame is where the first answer sends the camera from 75°."""
    (first, *_) = re.findall(r"rotate by ([+-]\d+)°", "\n".join(ANSWERS))
    there = 75 + int(first)
    assert f"--rotations 0 {int(first)}" in COMMANDS[-1]
    assert f"--azimuth {there % 360} " in COMMANDS[-2]
    words = " ".join(TEXT.replace("−", "-").split())
    same = "" if 0 <= there < 360 else f", which is {there % 360}°"
    assert f"75 {first[0]} {first[1:]} = {there}°{same}" in words


def test_the_picture_is_the_one_that_the_command_draws(printed, folder):
    with Image.open(folder / "answer.png") as drawn:
        found = np.asarray(drawn.convert("L"), dtype=float)
    with Image.open(ROOT / "docs/images/recommendation.png") as kept:
        shown = np.asarray(kept.convert("L"), dtype=float)
    assert found.shape == shown.shape
    assert np.abs(found - shown).mean() < 0.2


def test_the_readme_shows_the_same_answer(printed):
    text = (ROOT / "README.md").read_text("utf-8")
    shown = re.findall(r"^    (.+)$", text, re.MULTILINE)
    assert shown == [ANSWERS[1]]
    assert "nbv render --example --output frame.npy && nbv recommend frame.npy\n" in text


def test_the_python_runs_as_it_is_shown(tmp_path, capsys):
    (snippet,) = re.findall(r"^```python\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)
    (tmp_path / "snippet.py").write_text(snippet, "utf-8")
    runpy.run_path(str(tmp_path / "snippet.py"))
    (comment,) = re.findall(r"^print\(.*  # (.+)$", snippet, re.MULTILINE)
    assert capsys.readouterr().out.strip() == comment
