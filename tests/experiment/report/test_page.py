import json
import re
from html.parser import HTMLParser
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest

from nbv.errors import UserError
from nbv.experiment.paper.claims import CLAIMS
from nbv.experiment.paper.verdicts import evaluate_claims
from nbv.experiment.plan import too_small
from nbv.experiment.report.figures import FIGURES
from nbv.experiment.report.page import build_report, inline_svg, svg_text
from nbv.experiment.report.table import write_table
from nbv.experiment.report.tables import TABLES, claims_table
from nbv.style import INK, RC, new_figure
from projects import ROOT
from reports import report_files

VOID = {"meta", "img", "br", "link", "hr"}
FACTS = '<dl class="facts">'


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
def inputs(tree, evaluations, tmp_path_factory):
    """The named files of a report, each in a place of its own."""

    def drawn(name):
        figure = new_figure(3, 2)
        figure.subplots().text(0, 0, f"drawn as {name}")
        return figure

    return report_files(tmp_path_factory.mktemp("report"), tree, evaluations, drawn)


@pytest.fixture(scope="module")
def wordy(inputs, tmp_path_factory):
    """The same where no claim was run: its page is made sooner, for tests of words alone."""
    path = tmp_path_factory.mktemp("wordy") / "claims.csv"
    write_table(claims_table(evaluate_claims({}, np.random.default_rng(0), 2)), {"csv": path})
    return inputs | {"claims": path}


@pytest.fixture(scope="module")
def html(inputs):
    return build_report(**inputs)


@pytest.fixture(scope="module")
def page(html):
    return Page(html)


def test_it_is_well_formed(page, html):
    assert html.startswith("<!DOCTYPE html>\n")
    assert page.open == []
    assert {"html", "main", "nav", "h1", "section", "figure"} <= {tag for tag, _ in page.tags}


def test_it_needs_nothing_but_itself(page, html):
    drawings = [attrs for tag, attrs in page.tags if tag == "svg"]
    for attrs in drawings:
        assert attrs["role"] == "img"
        assert len(attrs["aria-label"]) > 20
    for name in FIGURES:
        assert f"drawn as {name}" in html
    for tag, attrs in page.tags:
        assert tag not in {"script", "link", "iframe", "object", "img"}
        assert attrs.get("href", "#").startswith(("#", "data:", "../../docs/"))
    assert set(re.findall(r"url\((.)", html)) <= {"#"}
    assert "http" not in html


def test_the_contents_lead_somewhere(page):
    targets = [attrs["href"] for tag, attrs in page.tags if tag == "a"]
    assert {link[1:] for link in targets if link.startswith("#")} <= page.ids
    files = [link for link in targets if not link.startswith("#")]
    assert files
    assert all((ROOT / link.removeprefix("../../")).is_file() for link in files)
    assert {*TABLES, *FIGURES} <= page.ids


def test_pictures_come_first_then_tables_claims_and_figures(html):
    parts = ("tables", "claims", "figures", "settings", "runtime")
    places = [html.index(f'<section id="{key}">') for key in parts]
    assert places == sorted(places)
    opening = html[: places[0]]
    assert re.findall(r'<figure id="([^"]+)"', opening) == [
        "table1-picture",
        "claims-forest",
        "steps",
    ]
    assert html.count('class="badge') == len(CLAIMS)


def test_it_shows_the_tables_that_were_written(html, inputs):
    for path in (*inputs["tables"].values(), inputs["runtime"]):
        assert path.read_text() in html


def test_it_says_what_was_run(page):
    text = " ".join(page.text)
    for words in (
        "experiment synthetic",
        "procedural",
        "Mug 9",
        "0123456789abcdef",
        "torch 2.13.0",
        "each other one from the elevation below",
    ):
        assert words in text
    assert "nan" not in text.lower().split()


@pytest.mark.parametrize(
    ("given", "shown"),
    [("given_estimate", "T = V"), ("given_truth", "T = L"), ("through_estimate", "T = L V")],
)
@pytest.mark.parametrize("candidates", [1, 2])
def test_it_says_at_first_how_proposed_fills_in_the_paper(
    wordy, tmp_path, given, shown, candidates
):
    settings = json.loads(wordy["configuration"].read_text())
    settings["density"]["pose_likelihood"] = given
    settings["density"]["bandwidths_deg"] = [8.0, 16.0][:candidates]
    settings["density"]["pseudo_observations"] = [3.0]
    path = tmp_path / "configuration.yaml"
    path.write_text(json.dumps(settings))
    text = build_report(**wordy | {"configuration": path}).split(FACTS)[0]
    assert f"({shown})" in text
    assert ("err least on calibration objects" in text) == (candidates > 1)
    assert ("8°" in text) == (candidates == 1)


def test_it_is_repeatable(inputs, html):
    assert build_report(**inputs) == html


def test_absent_figures_are_named(wordy):
    fewer = {name: path for name, path in wordy["figures"].items() if name != "pea"}
    assert "Not made in this run: pea." in build_report(**wordy | {"figures": fewer})


@pytest.mark.parametrize("name", ["claims", "configuration", "provenance", "runtime", "table1"])
def test_what_it_cannot_do_without_is_named(wordy, tmp_path, name):
    absent = tmp_path / "absent.file"
    with pytest.raises(UserError, match=r"absent\.file does not exist"):
        build_report(**wordy | {name: absent})


@pytest.mark.parametrize("kind", ["tables", "figures"])
def test_a_file_that_was_promised_has_to_be_there(wordy, tmp_path, kind):
    promised = wordy[kind] | {next(iter(wordy[kind])): tmp_path / "absent.file"}
    with pytest.raises(UserError, match=r"absent\.file does not exist"):
        build_report(**wordy | {kind: promised})


def test_text_is_escaped(wordy, tmp_path):
    path = tmp_path / "configuration.yaml"
    text = wordy["configuration"].read_text()
    path.write_text(text.replace("procedural", "<script>alert(1)</script>"))
    found = build_report(**wordy | {"configuration": path})
    assert "<script" not in found
    assert found.count("&lt;script&gt;alert(1)&lt;/script&gt;") == 2


def test_claims_that_were_not_run_come_last_and_folded_away(html):
    claims = html[html.index('<section id="claims">') : html.index('<section id="figures">')]
    run, absent = claims.split('<details class="absent">')
    assert 'class="badge none"' not in run
    assert 'class="badge holds"' in run
    folded = absent[: absent.index("</section>")]
    n_folded = folded.count('class="badge')
    assert folded.count('class="badge none"') == n_folded > 0
    assert f"Not run: {n_folded} of {len(CLAIMS)}" in folded


def test_verdicts_are_counted_at_the_top_alone(html):
    counted = r"\d+ (?:holds?|do(?:es)? not hold)\b"
    top, rest = html.split("</header>")
    assert re.search(counted, top)
    assert not re.search(counted, re.sub("<details.*?</details>", "", rest, flags=re.DOTALL))


def test_badges_differ_by_more_than_colour(html):
    badges = dict(re.findall(r'<span class="badge (\w+)">(\S) ', html))
    assert len(badges) == len(set(badges.values())) == 4


def test_each_claim_that_was_run_has_a_picture_and_its_numbers_behind_a_fold(html):
    claims = html[html.index('<section id="claims">') : html.index('<section id="figures">')]
    run = claims.split('<details class="absent">')[0]
    articles = run.split("<article")[1:]
    assert articles
    for article in articles:
        assert article.count("<svg") == 1
        assert article.index("<summary>Numbers") < article.index("<table")


def test_it_says_first_that_a_run_is_too_small(wordy, html):
    caution = too_small({"mug": 9}, 8)
    warned = build_report(**wordy | {"caution": caution})
    assert 'class="caution" role="note"' not in html
    header = warned[: warned.index("</header>")]
    assert not re.search("Here this|checkable sentences", header)
    assert re.search("Of the paper's|does not have", html)
    assert "too small for its numbers to mean anything: 9 objects of mug" in header


@pytest.mark.parametrize(
    ("better", "verdict"), [(5.0, "holds"), (-5.0, "does not hold"), (0.0, "is undecided")]
)
@pytest.mark.slow
def test_it_opens_with_what_became_of_the_conclusion(
    inputs, evaluations, tmp_path, better, verdict
):
    """All five categories, with errors of Proposed that are better than Opposite's by so much."""
    mug = evaluations["mug", 0]
    opposite = mug[mug["method"] == "opposite"]["error_deg"].to_numpy()
    noise = np.random.default_rng(1).normal(0.0, 3.0, opposite.size)
    changed = mug.copy()
    changed.loc[mug["method"] == "proposed", "error_deg"] = opposite - better + noise
    for other in ("single", "random"):
        changed.loc[mug["method"] == other, "error_deg"] = opposite + 20.0
    units = {(category, 0): changed for category in ("airplane", "car", "chair", "mug", "toilet")}
    claims = evaluate_claims(units, np.random.default_rng(0), 100)
    path = tmp_path / "claims.csv"
    write_table(claims_table(claims), {"csv": path})
    header = build_report(**inputs | {"claims": path}).split("</header>")[0]
    row = claims[(claims["id"] == "outperforms-all") & claims["versus"].str.startswith("Opp")].iloc[
        0
    ]
    assert f"Here this {verdict}" in header
    assert f"{row['value']:.2f}°, that of Opposite {row['versus_value']:.2f}°" in header


def test_without_all_categories_the_conclusion_is_left_open(html):
    assert "which this run does not have" in html.split("</header>")[0]


@pytest.fixture(scope="module")
def text():
    """A drawing with everything that has a name: markers, clipped lines, hatches and an image."""
    with mpl.rc_context(RC):
        figure = new_figure(2, 2)
        axes = figure.subplots()
        axes.plot([0, 1], [0, 1], "o", color="#0072B2")
        axes.bar([0], [1], hatch="//", facecolor="#D55E00", edgecolor=INK)
        axes.imshow(np.eye(3), interpolation="none")
        axes.set_xlabel("a < b & c")
    return svg_text(figure)


def test_every_name_is_the_drawings_own_and_leads_somewhere(text):
    first, second = (ElementTree.fromstring(inline_svg(text, name, "it")) for name in "ab")
    for root, name in ((first, "a"), (second, "b")):
        ids = [one.attrib["id"] for one in root.iter() if "id" in one.attrib]
        assert len(ids) == len(set(ids))
        assert all(one.startswith(f"{name}-") for one in ids)
        values = " ".join(value for one in root.iter() for value in one.attrib.values())
        named = set(re.findall(r"url\(#([^)]+)\)", values))
        named |= {one.attrib["href"][1:] for one in root.iter("use")}
        assert len(named) >= 3
        assert named <= set(ids)


def test_it_is_an_element_that_says_what_it_shows(text):
    root = ElementTree.fromstring(inline_svg(text, "a", "What < it shows"))
    assert root.tag == "svg"
    assert root.attrib["aria-label"] == "What < it shows"
    assert {"viewBox", "width", "role"} <= set(root.attrib)
    assert "a < b & c" in "".join(root.itertext())
    assert not {"metadata", "style"} & {one.tag for one in root.iter()}
    (image,) = root.iter("image")
    assert image.attrib["href"].startswith("data:image/png;base64,")


def test_ink_and_paper_are_the_pages_and_colours_of_methods_stay(text):
    page = inline_svg(text, "a", "it")
    assert "var(--ink)" in page
    assert "var(--page)" in page
    assert {"#0072b2", "#d55e00"} <= set(re.findall(r"#[0-9a-f]{6}", page))
    assert "http" not in page


def test_coordinates_keep_two_decimals(text):
    def points(drawn):
        root = ElementTree.fromstring(drawn)
        paths = (one.attrib["d"] for one in root.iter() if one.tag.endswith("path"))
        return np.array([float(x) for d in paths for x in re.findall(r"-?\d+\.?\d*", d)])

    np.testing.assert_allclose(points(inline_svg(text, "a", "it")), points(text), atol=0.01)
