"""The program: help, streams, missing packages, and mistakes of every command."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from commands import fails, run
from nbv.bundles.recommender import Recommender
from nbv.cli import main


def test_a_missing_or_damaged_bundle_is_one_line(here, capsys):
    assert "no-such" in fails(capsys, "recommend", "f0.npy", "--bundle", "no-such")
    (here / "m.csv").write_text("object_id,sequence,file,azimuth_deg\ncup,1,f0.npy,0\n")
    (here / "cut.safetensors").write_bytes((here / "b.safetensors").read_bytes()[:1000])
    for command in (
        ("recommend", "f0.npy", "--bundle", "cut.safetensors"),
        ("inspect", "cut.safetensors"),
        ("export", "cut.safetensors", "--onnx", "x.onnx"),
        ("evaluate", "m.csv", "--bundle", "cut.safetensors"),
        ("calibrate", "m.csv", "--bundle", "cut.safetensors", "--output", "x.safetensors"),
    ):
        assert "cut.safetensors" in fails(capsys, *command)


@pytest.mark.parametrize("command", [["recommend", "f0.npy", "--json"], ["inspect"]])
def test_a_reader_that_has_seen_enough_is_no_error(here, command):
    script = "import sys; from nbv.cli import main; sys.exit(main(sys.argv[1:]))"
    more = ["--bundle", "b.safetensors"] if "recommend" in command else ["b.safetensors"]
    program = subprocess.Popen(
        [sys.executable, "-c", script, *command, *more],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    program.stdout.close()
    assert program.wait() == 0
    assert program.stderr.read() == b""
    program.stderr.close()


def program(command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """The program, run by a shell: `nbv` in the command."""
    nbv = f"{sys.executable} -c 'from nbv.cli import run; run()'"
    return subprocess.run(
        ["sh", "-c", command.replace("nbv", nbv)],
        capture_output=True,
        text=True,
        env=os.environ | environment,
    )


def test_characters_that_an_encoding_lacks_are_escaped(here):
    for name, options in (("text", ""), ("json", "--json")):
        command = f"nbv recommend f0.npy --bundle b.safetensors {options}"
        plain, escaped = (
            program(command, PYTHONIOENCODING=encoding) for encoding in ("utf-8", "ascii")
        )
        assert (escaped.returncode, escaped.stderr) == (0, ""), name
        if options:
            assert json.loads(escaped.stdout) == json.loads(plain.stdout)
        else:
            assert escaped.stdout.encode() == plain.stdout.encode("ascii", "backslashreplace")


def test_a_closed_stream_is_no_traceback(here):
    done = program("nbv inspect b.safetensors >&-")
    assert done.returncode == 2
    assert (
        done.stderr
        == "nbv: error: standard output is closed: redirect it to a file or to /dev/null\n"
    )
    done = program("nbv inspect b.safetensors 2>&-")
    assert done.returncode == 0
    assert done.stdout == program("nbv inspect b.safetensors").stdout
    # Where there is no place for a mistake's line, output is none.
    done = program("nbv inspect no-such 2>&-")
    assert (done.returncode, done.stdout) == (2, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.slow
def test_a_full_disk_is_one_line(here, unbuffered):
    line = "nbv: error: standard output: No space left on device\n"
    for command in ("inspect b.safetensors", "inspect b.safetensors --json", "--help"):
        done = program(f"nbv {command} >/dev/full", PYTHONUNBUFFERED=unbuffered)
        assert (done.returncode, done.stderr) == (2, line)
    # Of two mistakes the first is told.
    done = program("nbv inspect no-such --json >/dev/full", PYTHONUNBUFFERED=unbuffered)
    assert done.returncode == 2
    assert done.stderr.startswith("nbv: error: no-bundle: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_a_picture_that_has_no_space_is_one_line(here):
    # The limit holds for matplotlib's cache of fonts, too.
    cache = {"MPLCONFIGDIR": str(here / "cache")}
    command = "nbv recommend f0.npy --bundle b.safetensors --plot"
    assert program(f"{command} first.png", **cache).returncode == 0
    for name in ("x.png", "x.pdf"):
        done = program(f"ulimit -f 2; {command} {name}", **cache)
        assert done.returncode == 2
        assert done.stderr == f"nbv: error: {name}: File too large\n"
        assert not list(here.glob("*.partial*"))
        assert not (here / name).exists()


def test_paths_are_checked_before_a_network_runs(here, capsys, monkeypatch):
    monkeypatch.setattr(Recommender, "load", lambda *_: pytest.fail("too late"))
    frames = ("recommend", "f0.npy")
    assert "--plot=x.gif" in fails(capsys, *frames, "--plot", "x.gif")
    assert "is a file" in fails(capsys, *frames, "--plot", "pose.json/x.png")
    assert "no-pose.npy" in fails(
        capsys, *frames, "--camera-pose", "no-pose.npy", "--axis", "0", "0", "0"
    )
    (here / "locked").mkdir(mode=0o500)
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).name != "locked")
    message = fails(capsys, *frames, "--plot", "locked/x.png")
    assert "is not writable" in message
    message = fails(capsys, "evaluate", "m.csv", "--output", "locked/x.csv")
    assert "is not writable" in message


def test_help_and_version_succeed(capsys):
    text = run(capsys, "--help")
    for command in ("recommend", "next", "calibrate", "evaluate", "inspect", "export"):
        assert command in text
        told = run(capsys, command, "--help")
        assert "Usage: nbv" in told
        assert f"Example: nbv {command} " in told
    assert run(capsys, "--version").strip() == __import__("nbv").__version__


def test_unknown_commands_and_options_are_one_line(here, capsys):
    assert "recomend" in fails(capsys, "recomend")
    for command in ("recommend", "calibrate", "evaluate", "inspect", "export"):
        fails(capsys, command, "--no-such-option")


def test_help_imports_nothing_heavy():
    script = (
        "import sys\nfrom nbv.cli import main\ncode = main(['--help'])\n"
        "heavy = {'numpy', 'torch', 'pandas', 'scipy', 'onnxruntime', 'matplotlib'}\n"
        "sys.exit(code or ' '.join(heavy & set(sys.modules)) or 0)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("recommend", "f0.npy", "--far", "0.1", "--bundle", "b.safetensors"), "empty-mask"),
        (("inspect", "no-such"), "no-bundle"),
        (("recommend", "--near", "x"), None),
        (("export", "b.safetensors", "--onnx", "locked/x.onnx"), None),
    ],
)
def test_a_mistake_is_json_where_json_is_wanted(here, capsys, monkeypatch, arguments, name):
    def locked(*_, **__):
        raise PermissionError(13, "Permission denied", "locked")

    monkeypatch.setattr(Path, "mkdir", locked)
    line = fails(capsys, *arguments)
    assert main([*arguments, "--json"]) == 2
    out, err = capsys.readouterr()
    assert err.strip() == line
    assert json.loads(out) == {
        "error": {"name": name, "message": line.removeprefix("nbv: error: ")}
    }


WITHOUT = """
import sys
from importlib.machinery import PathFinder

class Absent(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name in sys.argv[1].split() else super().find_spec(name, path, target)

sys.meta_path[sys.meta_path.index(PathFinder)] = Absent
from nbv.cli import main
from nbv.cli.arguments import as_paragraphs
for command in sys.argv[2:]:
    if main(command.split()):
        sys.exit(command)
"""


EXPERIMENT = ("torch", "pyrender", "hydra", "omegaconf", "pydantic", "psutil", "grimp")
EXPERIMENT += ("snakemake", "jinja2", "onnx")


@pytest.mark.slow
def test_a_robot_needs_no_package_of_the_experiment(manifest, pairs):
    commands = (
        "recommend f0.npy --bundle b.safetensors --plot plot.png",
        "calibrate pairs.csv --output t.npz",
        "next t.npz --estimate 90",
        "evaluate manifest.csv --bundle b.safetensors --views 2",
        "inspect b.safetensors",
        "render --example --output new.npy",
        "export b.safetensors --onnx new.onnx",
    )
    command = [sys.executable, "-c", WITHOUT, " ".join(EXPERIMENT), *commands]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
