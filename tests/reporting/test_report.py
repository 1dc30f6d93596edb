from __future__ import annotations

import base64
import shutil
from html.parser import HTMLParser

import numpy as np
import pytest

from nbv.errors import UserError
from nbv.files import write_csv
from nbv.paper.claims import CLAIMS
from nbv.paper.verdicts import evaluate_claims
from nbv.reporting.page import badge, escape
from nbv.reporting.paper.figures import FIGURES, FigureInputs, build_figure, save_figure
from nbv.reporting.paper.layout import save_table
from nbv.reporting.paper.tables import TABLES, build_table
from nbv.reporting.report import build_report
from nbv.reporting.settings import ReportSettings

VOID = {"meta", "img", "br", "link", "hr"}


class Page(HTMLParser):
    """Collects what a page is made of, and checks that its tags are closed in order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.ids, self.text = [], [], set(), []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if "id" in dict(attrs):
            assert dict(attrs)["id"] not in self.ids
            self.ids.add(dict(attrs)["id"])
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def root(tree, evaluations, tmp_path_factory):
    root = tmp_path_factory.mktemp("report") / "synthetic"
    shutil.copytree(tree, root)
    settings = ReportSettings(n_resamples=100)
    for name in TABLES:
        save_table(build_table(name, evaluations, settings), root / "tables" / name)
    for name in FIGURES:
        save_figure(
            build_figure(name, FigureInputs(root, evaluations, settings)), root / "figures" / name
        )
    claims = evaluate_claims(evaluations, np.random.default_rng(0), 100)
    write_csv(root / "claims.csv", claims)
    return root


@pytest.fixture(scope="module")
def html(root):
    return build_report(root)


@pytest.fixture(scope="module")
def page(html):
    return Page(html)


def test_it_is_well_formed(page):
    assert page.open == []
    assert {"html", "main", "nav", "h1", "section", "figure"} <= {tag for tag, _ in page.tags}


def test_it_needs_nothing_but_itself(page, html):
    images = [attrs for tag, attrs in page.tags if tag == "img"]
    assert len(images) == len(FIGURES)
    for attrs in images:
        kind, data = attrs["src"].split(",", 1)
        assert kind == "data:image/png;base64"
        assert base64.b64decode(data).startswith(b"\x89PNG")
        assert len(attrs["alt"]) > 20
    for tag, attrs in page.tags:
        assert tag not in {"script", "link", "iframe", "object"}
        assert attrs.get("href", "#").startswith("#")
    assert "url(" not in html
    assert "http" not in html
    assert len(html) < 5_000_000


def test_the_contents_lead_somewhere(page):
    targets = [attrs["href"][1:] for tag, attrs in page.tags if tag == "a"]
    assert targets
    assert set(targets) <= page.ids


def test_claims_come_first_then_tables_then_figures(html):
    places = [html.index(f'<section id="{key}">') for key in ("claims", "tables", "figures")]
    assert places == sorted(places)
    assert html.count('class="badge') == len(CLAIMS)


def test_it_says_what_was_run(page):
    text = " ".join(page.text)
    for words in (
        "experiment synthetic",
        "procedural",
        "Mug 9",
        "0123456789abcdef",
        "torch 2.13.0",
    ):
        assert words in text
    assert "nan" not in text.lower().split()


def test_it_is_repeatable(root, html):
    assert build_report(root) == html


def test_absent_parts_are_named(root, tmp_path):
    copy = tmp_path / "partial"
    shutil.copytree(root, copy)
    (copy / "figures" / "pea.png").unlink()
    (copy / "tables" / "table6.md").unlink()
    shutil.rmtree(copy / "benchmarks")
    text = build_report(copy)
    assert "Not made in this run: pea." in text
    assert "Not made in this run: table6." in text
    assert "No job was timed" in text


@pytest.mark.parametrize("name", ["claims.csv", "configuration.yaml", "provenance.json"])
def test_what_it_cannot_do_without_is_named(root, tmp_path, name):
    copy = tmp_path / "partial"
    shutil.copytree(root, copy)
    (copy / name).unlink()
    with pytest.raises(UserError, match=f"{name} does not exist"):
        build_report(copy)


def test_text_is_escaped(root, tmp_path):
    copy = tmp_path / "escaped"
    shutil.copytree(root, copy)
    path = copy / "configuration.yaml"
    path.write_text(path.read_text().replace("procedural", "<script>alert(1)</script>"))
    assert "<script" not in build_report(copy)
    assert escape('a<b & "c"') == "a&lt;b &amp; &quot;c&quot;"


def test_what_an_earlier_configuration_left_is_passed_over(root, tmp_path, html):
    copy = tmp_path / "stale"
    shutil.copytree(root, copy)
    shutil.copytree(copy / "evaluation" / "mug" / "el00", copy / "evaluation" / "mug" / "el75")
    shutil.copytree(copy / "evaluation" / "mug", copy / "evaluation" / "spoon")
    shutil.copytree(copy / "benchmarks" / "train" / "mug", copy / "benchmarks/train/spoon")
    assert build_report(copy) == html


def test_claims_that_were_not_run_come_last_and_folded_away(html):
    claims = html[html.index('<section id="claims">') : html.index('<section id="tables">')]
    run, absent = claims.split("<details>")
    assert 'class="badge none"' not in run
    assert 'class="badge holds"' in run
    folded = absent[: absent.index("</details>")]
    n_folded = folded.count('class="badge')
    assert folded.count('class="badge none"') == n_folded > 0
    assert f"Not run: {n_folded} of {len(CLAIMS)}" in folded


def test_badges_differ_by_more_than_colour():
    verdicts = ("holds", "does not hold", "undecided", "not run")
    signs = {badge(verdict).split(">")[1].split()[0] for verdict in verdicts}
    assert len(signs) == 4
