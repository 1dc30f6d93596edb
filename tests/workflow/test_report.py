"""Snakemake's own report of a run: made without a network, with what each result shows."""

import json
import re
import subprocess
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow


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
