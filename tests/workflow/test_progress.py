"""What a person sees of a real run: one line that says how far it is, and what goes wrong."""

from __future__ import annotations

import json
import os
import pty
import re
import subprocess
import threading
import zipfile
from itertools import pairwise
from pathlib import Path

import pytest

from nbv.experiment.jobs import ERASE_LINE
from projects import ROOT

pytestmark = pytest.mark.slow

LOOKUPS = tuple(f"results/tiny/lookup/mug/el00/fold{k}/pose_ambiguity.npz" for k in (1, 2))
TWO_JOBS = ("--cores", "2", "--force", *LOOKUPS)
LAST_LINE = re.compile(
    r"(?:^|\x1b\[K)\[\d\d:\d\d:\d\d nbv\] 100 % done in [\dminh s]+, (\d+) of \1 jobs$", re.M
)
CHATTER = ("Select jobs", "Finished jobid", "steps (", "Building DAG", "Job stats", "rule lookup:")


def run_on_a_terminal(project, *arguments: str) -> tuple[int, str]:
    """Return the status of a run and what it wrote on a terminal, its standard error."""
    ours, theirs = pty.openpty()
    written: list[bytes] = []

    def read() -> None:
        while True:
            try:
                written.append(os.read(ours, 65536))
            except OSError:
                return

    reader = threading.Thread(target=read)
    reader.start()
    environment = project.environment | {"TERM": "xterm", "COLUMNS": "120"}
    done = subprocess.run(
        project.command(*arguments),
        cwd=project.folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=theirs,
        timeout=600,
    )
    os.close(theirs)
    reader.join(timeout=30)
    os.close(ours)
    return done.returncode, b"".join(written).decode().replace("\r\n", "\n")


def test_a_log_has_the_line_once_a_minute_and_at_the_end_and_nothing_of_snakemake(scratch):
    before = scratch.outcome()
    done = scratch.run(*TWO_JOBS)
    lines = [line for line in done.stderr.splitlines() if " nbv] " in line]
    clock = re.findall(r"^\[(\d\d):(\d\d):(\d\d) nbv\]", done.stderr, re.M)
    times = [3600 * int(h) + 60 * int(m) + int(s) for h, m, s in clock]
    assert LAST_LINE.search(lines[-1])
    assert all((after - before) % 86400 >= 59 for before, after in pairwise(times[:-1]))
    assert "nbv: finished" in done.stderr
    assert "2 jobs to do (" in done.stderr
    assert not [words for words in CHATTER if words in done.stdout + done.stderr]
    assert "lookup mug/00" not in done.stderr
    assert ERASE_LINE not in done.stderr
    assert scratch.outcome() == before


def test_verbose_brings_everything_back_and_changes_no_result(scratch):
    before = scratch.outcome()
    command = [*scratch.command(*TWO_JOBS), "verbose=true"]
    done = subprocess.run(
        command, cwd=scratch.folder, env=scratch.environment, capture_output=True, text=True
    )
    assert done.returncode == 0
    assert not [words for words in CHATTER if words not in done.stderr]
    assert re.search(r"^\[\d\d:\d\d:\d\d lookup mug/00/1/pose_ambiguity\] ", done.stderr, re.M)
    assert LAST_LINE.search(done.stderr)
    assert scratch.outcome() == before


def test_verbose_is_true_or_false(fresh):
    done = subprocess.run(
        [*fresh.command("--cores", "1"), "verbose=maybe"],
        cwd=fresh.folder,
        env=fresh.environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode != 0
    assert "nbv: error: --config verbose=maybe: write true or false" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_terminal_shows_one_line_that_is_written_over(scratch):
    status, written = run_on_a_terminal(scratch, *TWO_JOBS)
    assert status == 0
    during = written[written.index("2 jobs to do") : LAST_LINE.search(written).start()]
    shown = re.findall(re.escape(ERASE_LINE) + r"\[\d\d:\d\d:\d\d nbv\] ([^\r\n]*)", during)
    assert len(shown) >= 2
    assert all(len(line) < 120 for line in shown)
    assert any("lookup" in line for line in shown)
    assert "\n" not in during[during.index(ERASE_LINE) :]
    assert not [words for words in CHATTER if words in written]


def test_an_error_interrupts_the_line_and_is_said_again_at_the_end(scratch):
    damaged = scratch.results / "estimates/mug/el00/fold1/calibration.csv"
    times = damaged.stat()
    damaged.write_bytes(damaged.read_bytes().replace(b"mug", b"mgu", 1))
    os.utime(damaged, ns=(times.st_atime_ns, times.st_mtime_ns))
    status, written = run_on_a_terminal(scratch, *TWO_JOBS)
    assert status != 0
    error = "error: results/tiny/estimates/mug/el00/fold1/calibration.csv changed after it was"
    told = re.findall(r"(?:\n|\x1b\[K)(\[[^\]]* lookup [^\]]*\] )?" + re.escape(error), written)
    assert len(told) == 2
    assert written.index("nbv: stopped") < written.rindex(error)
    assert "CalledProcessError" not in written
    assert "Traceback" not in written
    assert not LAST_LINE.search(written)


def test_a_dry_run_still_says_what_would_run(scratch):
    done = scratch.run(*TWO_JOBS, "--dry-run")
    assert re.search(r"^lookup +2$", done.stdout, re.M)


def test_nothing_to_do_is_said(finished):
    assert "Nothing to be done" in finished.run("--cores", "1").stderr


def test_quiet_all_shows_no_line(scratch):
    done = scratch.run(*TWO_JOBS, "--quiet", "all")
    assert " nbv] " not in done.stderr


def test_snakemakes_own_report_is_made_without_a_network_and_says_what_each_result_shows(
    finished, tmp_path
):
    nowhere = "http://127.0.0.1:9"
    target = tmp_path / "report.zip"
    done = subprocess.run(
        finished.command("--report", str(target)),
        cwd=finished.folder,
        env=finished.environment | {"http_proxy": nowhere, "https_proxy": nowhere},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(target) as archive:
        page = archive.read("report/report.html").decode()
        kept = {name.rpartition("/")[2] for name in archive.namelist()}
    results = json.loads(re.search(r"var results = (\{.*\});\n", page)[1])
    shown = {Path(path).name: result for path, result in results.items()}
    assert set(shown) <= kept
    assert {"report.html", "claims.csv", "runtime.html", "table1.html", "figure2.png"} <= set(shown)
    tables = [result["labels"] for name, result in shown.items() if name.startswith("table")]
    assert {label["table"] for label in tables} == {f"Table {n}" for n in range(1, 8)}
    for name, result in shown.items():
        caption = re.sub("<[^>]+>", "", result["caption"])
        assert "seed 0" in caption.lower()
        made_of = "16 objects" if name in ("report.html", "runtime.html") else "mug: 8 objects from"
        assert made_of in caption
    assert "100 bootstrap resamples" in shown["claims.csv"]["caption"]
    categories = json.loads(re.search(r"var categories = (\{.*\});\n", page)[1])
    assert set(categories) == {"Report", "Claims", "Tables", "Figures", "Running time"}
    asked = re.findall(r"<(?:script|link|img|iframe)[^>]+(?:src|href)=[\"']?https?:", page)
    assert not asked


def test_the_first_make_says_what_it_does_and_how_long_that_usually_takes(tmp_path):
    command = ["make", "--dry-run", "--always-make", "reproduce", f"VENV={tmp_path / 'venv'}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    order = ["echo.*environment.*two minutes", "-m venv", "echo.*paper.*half an hour", "snakemake"]
    places = [re.search(words, done.stdout) for words in order]
    assert all(places)
    starts = [place.start() for place in places]
    assert starts == sorted(starts)
