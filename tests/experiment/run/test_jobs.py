import errno
import logging
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from nbv.errors import UserError
from nbv.experiment.run.jobs import (
    LAST_ERROR,
    NO_SPACE,
    begin_run,
    check,
    check_folders,
    import_from,
    job,
    need_intact,
    states_of_files,
    why_stopped,
    write_checksum,
)


@pytest.fixture(autouse=True)
def environment():
    """A run that a test begins leaves nothing in the environment of later tests."""
    before = dict(os.environ)
    yield
    os.environ.clear()
    os.environ.update(before)


@pytest.fixture
def snakemake(tmp_path):
    yield SimpleNamespace(
        input=[],
        output=["out.csv"],
        log=[str(tmp_path / "logs" / "train" / "mug.log")],
        rule="train",
        wildcards=["mug", "00"],
    )
    root = logging.getLogger()
    for handler in root.handlers[:]:
        if type(handler) in (logging.FileHandler, logging.StreamHandler):
            root.removeHandler(handler)
            handler.close()


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (UserError("x.obj: no faces"), "error: x.obj: no faces"),
        (
            OSError(errno.ENOSPC, "No space left on device"),
            "error: out.csv: no space left on the disk; free some and run the same command again",
        ),
        (
            OSError(errno.EROFS, "Read-only file system", "a.npy"),
            "error: a.npy: cannot be written, the file system is read-only",
        ),
        (
            MemoryError("Unable to allocate 7 TiB"),
            "error: memory ran out (Unable to allocate 7 TiB): use fewer --cores, or smaller "
            "settings",
        ),
        (
            RuntimeError("[enforce fail] DefaultCPUAllocator: can't allocate memory: 9 bytes"),
            "error: memory ran out ([enforce fail] DefaultCPUAllocator: can't allocate memory: 9 "
            "bytes): use fewer --cores, or smaller settings",
        ),
    ],
)
def test_a_mistake_is_one_line_everywhere(snakemake, tmp_path, capsys, error, line):
    with pytest.raises(SystemExit) as exit_, job(snakemake):
        raise error
    assert exit_.value.code == 1
    assert (tmp_path / "logs" / "last_error.txt").read_text() == line + "\n"
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1
    assert f"train mug/00] {line}" in printed


def test_an_error_while_tidying_up_hides_no_full_disk(snakemake, capsys):
    """As with a PDF that matplotlib cannot finish."""

    def write() -> None:
        try:
            raise OSError(errno.ENOSPC, "No space left on device")
        finally:
            raise AttributeError("'Stream' object has no attribute 'pos'")

    with pytest.raises(SystemExit), job(snakemake):
        write()
    assert "error: out.csv: no space left on the disk" in capsys.readouterr().err


def test_a_crash_keeps_its_traceback_in_the_log_alone(snakemake, capsys):
    with pytest.raises(SystemExit), job(snakemake):
        raise ZeroDivisionError("oh")
    assert "Traceback" not in capsys.readouterr().err
    assert "Traceback" in Path(snakemake.log[0]).read_text()


def test_progress_goes_to_the_log_and_once_a_minute_to_the_terminal(snakemake, capsys, monkeypatch):
    clock_s = [1000.0]
    monkeypatch.setattr("nbv.experiment.run.jobs.time.monotonic", lambda: clock_s[0])
    with job(snakemake):
        for epoch in range(1, 10):
            clock_s[0] += 20.0
            logging.getLogger("nbv.experiment.estimation").info("epoch %d", epoch)
        logging.getLogger("nbv.experiment.estimation").warning("no depth")
        logging.getLogger("nbv.experiment.run.reference").info(
            "agrees", extra={"for_terminal": True}
        )
    shown = [line.partition("] ")[2] for line in capsys.readouterr().err.splitlines()]
    assert shown == ["epoch 3", "epoch 6", "epoch 9", "no depth", "agrees"]
    assert Path(snakemake.log[0]).read_text().count("epoch") == 9


def test_inputs_are_held_to_their_checksums_and_outputs_get_theirs(
    snakemake, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    snakemake.input, snakemake.output = ["results/a/in.csv"], ["results/a/out.csv"]
    Path("results/a").mkdir(parents=True)
    Path("results/a/in.csv").write_text("whole")
    write_checksum("results/a/in.csv")
    with job(snakemake):
        Path("results/a/out.csv").write_text("made")
    assert Path("results/a/checksums/out.csv.sha256").is_file()
    Path("results/a/in.csv").write_text("wholf")
    with pytest.raises(SystemExit), job(snakemake):
        raise AssertionError("a damaged input was read")
    assert "results/a/in.csv differs" in Path("logs/last_error.txt").read_text()


@pytest.mark.parametrize("named", ["", "results/a/in.csv: "])
def test_an_error_names_the_files_that_the_job_read(snakemake, tmp_path, monkeypatch, named):
    monkeypatch.chdir(tmp_path)
    snakemake.input, snakemake.output = ["src/code.py", "results/a/in.csv"], []
    Path("results/a").mkdir(parents=True)
    Path("results/a/in.csv").write_text("whole")
    write_checksum("results/a/in.csv")
    with pytest.raises(SystemExit), job(snakemake):
        raise UserError(f"{named}object 'mug-0019' is missing")
    line = Path("logs/last_error.txt").read_text()
    assert line.count("results/a/in.csv") == 1
    assert "code.py" not in line


def test_a_log_that_cannot_be_written_is_named(snakemake, tmp_path, capsys):
    (tmp_path / "logs").write_text("a file where the folder should be")
    with pytest.raises(SystemExit), job(snakemake):
        pass
    assert "mug.log: cannot be written" in capsys.readouterr().err


@pytest.fixture
def ended(snakemake, tmp_path):
    def run(name, error=None):
        snakemake.log[0] = str(tmp_path / "results" / "logs" / f"{name}.log")
        try:
            with job(snakemake):
                if error is not None:
                    raise error
        except (SystemExit, KeyboardInterrupt):
            pass

    return run


KILLED = "error: killed from outside: "


def test_jobs_that_end_without_a_word_were_killed(ended, tmp_path):
    results = str(tmp_path / "results")
    logs = tmp_path / "results/logs"
    begin_run(results)
    ended("whole")
    ended("interrupted", KeyboardInterrupt())
    assert why_stopped(results) == []
    ended("crashed", ZeroDivisionError())
    ended("failed", UserError("x"))
    assert why_stopped(results) == ["error: x"]
    (logs / "train").mkdir()
    (logs / "train/mug.log").write_text("[10:00:00 train mug] epoch 3\n")
    (logs / "train/old.log").write_text("[10:00:00 train old] epoch 3\n")
    before = time.time() - 100
    os.utime(logs / "train/old.log", (before, before))
    failed, killed, advice = why_stopped(results)
    assert (failed, killed) == ("error: x", f"{KILLED}train/mug")
    assert "fewer --cores" in advice


def test_a_full_disk_is_named_where_it_cut_logs_off(ended, tmp_path):
    results = str(tmp_path / "results")
    begin_run(results)
    ended("failed", OSError(errno.ENOSPC, "No space left on device"))
    (tmp_path / "results/logs/cut.log").write_text("[10:00:00 cut] epo")
    assert why_stopped(results) == [f"error: out.csv: {NO_SPACE}"]


def test_a_disk_that_is_nearly_full_is_named_where_no_job_said_more(tmp_path, monkeypatch):
    results = str(tmp_path / "results")
    begin_run(results)
    monkeypatch.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=10**6))
    assert why_stopped(results) == [f"error: {results}: {NO_SPACE}"]


def test_a_run_begins_with_no_error(tmp_path):
    logs = tmp_path / "results/one/logs"
    logs.mkdir(parents=True)
    (logs / LAST_ERROR).write_text("error: of yesterday\n")
    begin_run(str(logs.parent))
    assert why_stopped(str(logs.parent)) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=r"file/two cannot be written"):
        begin_run(str(tmp_path / "file/two"))


def test_jobs_import_packages_of_a_folder_before_those_of_others(tmp_path, monkeypatch):
    (tmp_path / "beside.py").write_text("print('found')")
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setenv("PYTHONPATH", "/elsewhere")
    import_from(tmp_path)
    assert sys.path[0] == str(tmp_path)
    assert os.environ["PYTHONPATH"] == f"{tmp_path}{os.pathsep}/elsewhere"
    done = subprocess.run([sys.executable, "-c", "import beside"], capture_output=True, text=True)
    assert done.stdout == "found\n"


PATH = "results/tiny/estimates/mug/el00/fold1/test.csv"
CONTENT = b"object_id,azimuth_deg,estimate_deg\n" + bytes(range(256))


@pytest.fixture
def written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / PATH
    path.parent.mkdir(parents=True)
    path.write_bytes(CONTENT)
    write_checksum(PATH)
    return path


def flipped(content):
    return content[:100] + bytes([content[100] ^ 1]) + content[101:]


def _is_refused(state):
    assert states_of_files("results/tiny")[PATH].startswith(state)
    with pytest.raises(UserError, match=f"{PATH} {state}.* 1 files in all"):
        need_intact("results/tiny")
    with pytest.raises(UserError, match=f"{PATH} {state}.* run the same command again"):
        check(PATH)


def test_what_was_written_is_read_again(written):
    check(PATH)
    assert states_of_files("results/tiny") == {PATH: "is as written"}
    assert written.read_bytes() == CONTENT


@pytest.mark.skipif(shutil.which("sha256sum") is None, reason="no sha256sum here")
def test_another_program_verifies_the_same_files(written, tmp_path):
    record = tmp_path / "results/tiny/checksums/estimates/mug/el00/fold1/test.csv.sha256"
    subprocess.run(["sha256sum", "--check", "--strict", record], check=True, cwd=tmp_path)


@pytest.mark.parametrize(
    "damage", [flipped, lambda content: content[:-1], lambda _: b"", lambda content: content + b"x"]
)
def test_damage_is_noticed_whatever_the_time_of_the_file_and_the_file_is_set_aside(written, damage):
    times = written.stat()
    written.write_bytes(damage(CONTENT))
    os.utime(written, ns=(times.st_atime_ns, times.st_mtime_ns))
    _is_refused("differs from its checksum")
    assert not written.exists()
    assert written.with_name("test.csv.damaged").read_bytes() == damage(CONTENT)
    assert states_of_files("results/tiny") == {PATH: "is missing"}
    need_intact("results/tiny")


def test_files_of_no_run_have_no_checksum(written, tmp_path):
    for path in ("src/nbv/files.py", "results/loose.csv", str(tmp_path / "elsewhere.csv")):
        write_checksum(path)
        check(path)
    assert states_of_files("results/tiny") == {PATH: "is as written"}


@pytest.mark.parametrize("content", [CONTENT, CONTENT[:50]])
@pytest.mark.parametrize(
    "record", [None, "", "00", f"{'x' * 64}  {PATH}\n", f"{'0' * 64}  b.csv\n"]
)
def test_a_file_without_a_sound_checksum_is_noticed_and_only_the_checksum_is_blamed(
    written, record, content
):
    written.write_bytes(content)
    checksum = written.parents[4] / f"checksums/{PATH.removeprefix('results/tiny/')}.sha256"
    checksum.unlink()
    if record is not None:
        checksum.write_text(record)
    _is_refused("has no checksum" if record is None else "has a checksum that is damaged")


def test_logs_and_hidden_files_need_no_checksum(written):
    for name in ("logs/a.log", "benchmarks/a.tsv", ".DS_Store", "tables/.a.partial.csv"):
        path = Path("results/tiny", name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    assert states_of_files("results/tiny") == {PATH: "is as written"}


# A run that starts a job through a shell, which outlives a killed run.
RUN = """
import subprocess, sys
from nbv.experiment.run.jobs import begin_run
begin_run("results/tiny")
if len(sys.argv) > 1:
    subprocess.run(["bash", "-c", f"{sys.executable} {sys.argv[1]}; true"])
print("begun", flush=True)
sys.stdin.read()
"""
JOB = """
import time
from pathlib import Path
from nbv.experiment.run.jobs import end_with_run
end_with_run(Path("results/tiny/logs"))
for beat in range(600):
    Path("next.txt").write_text(str(beat))
    Path("next.txt").replace("beat.txt")
    time.sleep(0.1)
"""


def start_run(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", RUN, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def test_no_run_begins_beside_another_of_the_same_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    running = start_run()
    assert running.stdout.readline() == "begun\n"
    with pytest.raises(UserError, match="another run works on results/tiny: wait"):
        begin_run("results/tiny")
    begin_run("results/other")
    running.kill()
    running.communicate()
    begin_run("results/tiny")


@pytest.mark.slow
def test_a_job_ends_with_its_run_before_the_next_one_begins(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("job.py").write_text(JOB)
    running, beat = start_run("job.py"), Path("beat.txt")
    for _ in range(200):
        if beat.exists():
            break
        time.sleep(0.1)
    time.sleep(1)
    assert int(beat.read_text()) > 0
    running.kill()
    running.communicate()
    time.sleep(1)
    begin_run("results/tiny")
    last = beat.read_text()
    time.sleep(1)
    assert beat.read_text() == last


@pytest.mark.parametrize("path", ["results", "results/tiny", ".snakemake"])
def test_a_file_where_a_folder_should_be_is_one_line(tmp_path, monkeypatch, path):
    monkeypatch.chdir(tmp_path)
    check_folders("results/tiny")
    Path(path).parent.mkdir(exist_ok=True)
    Path(path).write_text("")
    with pytest.raises(UserError, match=f"^{path} is not a folder"):
        check_folders("results/tiny")


def test_a_folder_that_another_user_made_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path(".snakemake").mkdir()
    monkeypatch.setattr("os.access", lambda path, mode: Path(path).name != ".snakemake")
    with pytest.raises(UserError, match=f"{tmp_path}/.snakemake cannot be written: permission"):
        check_folders("results/tiny")


def test_a_copied_run_is_told_once_that_times_decide(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    begin_run("results/here")
    assert capsys.readouterr().err == ""
    shutil.copytree("results/here", "results/there")
    begin_run("results/there")
    (line,) = capsys.readouterr().err.splitlines()
    assert f"results/there is a copy of {tmp_path}/results/here" in line
    assert "--touch" in line
