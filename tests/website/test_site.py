"""The documentation site: built as `make docs` does, whole, and without anything from a network."""

import importlib.util
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import nbv

ROOT = Path(__file__).parents[2]
METHOD = ROOT / "docs/method.md"

# What a browser fetches by itself when it shows a page.
FETCHED = {
    ("img", "src"),
    ("img", "srcset"),
    ("script", "src"),
    ("link", "href"),
    ("source", "src"),
    ("source", "srcset"),
    ("video", "src"),
    ("iframe", "src"),
    ("object", "data"),
    ("embed", "src"),
}
# Relations of <link> that fetch nothing.
TOLD = {"index", "search", "next", "prev", "canonical", "author"}


def build(root: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the command of `make docs`, writing to another folder."""
    assert importlib.util.find_spec("sphinx"), "the site's packages are not installed: make docs"
    recipe = re.search(r"^\t.*(-m sphinx .*) build/site$", (ROOT / "Makefile").read_text(), re.M)
    assert recipe is not None
    options = recipe[1].replace("$(CORES)", "1").replace("build/", f"{folder}/").split()
    return subprocess.run(
        [sys.executable, *options, str(folder / "site")], cwd=root, capture_output=True, text=True
    )


@dataclass
class Page(HTMLParser):
    """What a page leads to, what it fetches, and what can be led to in it."""

    ids: set[str] = field(default_factory=set)
    links: list[str] = field(default_factory=list)
    fetched: list[str] = field(default_factory=list)
    n_equations: int = 0

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attributes}
        self.n_equations += tag == "math"
        self.ids |= {given[name] for name in ("id", "name") if name in given}
        if tag == "link" and given.get("rel") in TOLD:
            self.links.append(given["href"])
            return
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        self.fetched += [given[name] for one, name in FETCHED if one == tag and name in given]


def page_of(path: Path) -> Page:
    page = Page()
    page.feed(path.read_text("utf-8"))
    return page


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("built")
    done = build(ROOT, folder)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stderr == ""
    return folder / "site"


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    return {path: page_of(path) for path in sorted(site.rglob("*.html"))}


def inner(links: list[str]) -> Iterator[str]:
    yield from (link for link in links if not urlsplit(link).scheme)


def test_every_document_has_a_page(site):
    documents = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
    documents += (ROOT / "docs").rglob("*.md")
    made = [site / path.relative_to(ROOT).with_suffix(".html") for path in documents]
    assert not [path for path in made if not path.is_file()]
    assert (site / "index.html").read_bytes() == (site / "README.html").read_bytes()


def test_the_home_page_leads_to_every_page_for_readers(pages, site):
    home = pages[site / "index.html"]
    expected = {path.with_suffix(".html") for path in (ROOT / "docs").glob("*.md")}
    expected |= {path.with_suffix(".html") for path in (ROOT / "docs/api").glob("*.rst")}
    expected |= {path.with_suffix(".html") for path in (ROOT / "docs/reference").rglob("README.md")}
    linked = {urlsplit(link).path for link in home.links}
    assert not {str(path.relative_to(ROOT)) for path in expected} - linked


def test_every_link_and_anchor_of_the_site_leads_somewhere(pages, site):
    broken = []
    for path, page in pages.items():
        for link in inner(page.links + page.fetched):
            parts = urlsplit(link)
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchor = unquote(parts.fragment)
            there = target.is_file() and target.is_relative_to(site)
            if not there or (anchor and target in pages and anchor not in pages[target].ids):
                broken.append(f"{path.relative_to(site)}: {link}")
    assert sum(len(page.links) for page in pages.values()) > 10_000
    assert not broken, broken[:20]


def test_nothing_is_fetched_from_a_network(pages, site):
    outside = [
        f"{path.relative_to(site)}: {link}"
        for path, page in pages.items()
        for link in page.fetched
        if urlsplit(link).netloc or urlsplit(link).scheme not in ("", "data")
    ]
    for path in site.rglob("*.css"):
        called = re.findall(r"url\(\s*[\"']?([^\"')]+)|@import\s+[\"']([^\"']+)", path.read_text())
        outside += [
            f"{path.relative_to(site)}: {one or other}"
            for one, other in called
            if urlsplit(one or other).netloc
        ]
    call = re.compile(r"(?:fetch|importScripts|import)\(\s*[\"'`](?:https?:)?//[^\"'`]*")
    for path in [*pages, *site.rglob("*.js")]:
        outside += [f"{path.relative_to(site)}: {one}" for one in call.findall(path.read_text())]
    assert not outside, outside[:20]


def test_every_equation_of_the_method_is_typeset(pages, site):
    text = re.sub(r"`[^`\n]*`", "", METHOD.read_text("utf-8"))
    blocks = re.findall(r"^```math$.*?^```$", METHOD.read_text("utf-8"), re.M | re.S)
    inline = re.findall(r"\$[^$\n]+\$", text)
    assert len(blocks) >= 4
    assert len(inline) > 50
    shown = site / "docs/method.html"
    assert pages[shown].n_equations == len(blocks) + len(inline)
    assert not re.search(r"\$|\\(?:frac|sum|delta)", re.sub(r"<[^>]+>", "", body(shown)))


def body(path: Path) -> str:
    return path.read_text("utf-8").partition('<article role="main"')[2].partition("</article>")[0]


def test_each_symbol_leads_to_its_code(site):
    rows = re.findall(r"^\| \$.*$", METHOD.read_text("utf-8"), re.MULTILINE)
    names = re.findall(r"\[`(\w+)`\]", "\n".join(rows))
    assert len(rows) >= 20
    code_link = re.compile(r'href="(\S+)#(\S+)"[^>]*>(?:<\w+[^>]*>)*(\w+)<')
    shown = code_link.findall(body(site / "docs/method.html"))
    anchors = {name: (page, anchor) for page, anchor, name in shown}
    assert set(names) <= set(anchors)
    for name in names:
        page, anchor = anchors[name]
        line = re.fullmatch(r"L-(\d+)", anchor)
        if line is None:
            assert anchor.rpartition(".")[2] == name
        else:
            module = ROOT / page.removeprefix("../source/").removesuffix(".html")
            assert name in module.read_text("utf-8").splitlines()[int(line[1]) - 1]


def test_the_public_api_is_described(pages, site):
    ids = pages[site / "docs/api/index.html"].ids
    assert {f"nbv.{name}" for name in nbv.__all__} <= ids


def test_a_mistake_in_a_document_stops_the_build(tmp_path):
    mistakes = {
        "[gone](docs/nowhere.md)": "nowhere.md",
        "[gone](docs/data.md#nowhere)": "nowhere",
        "$\\nosuchcommand$": "nosuchcommand",
    }
    project = tmp_path / "project"
    for name in ("docs/site", "docs/data.md", "docs/method.md"):
        (project / name).parent.mkdir(parents=True, exist_ok=True)
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copyfile
        copy(ROOT / name, project / name)
    (project / "README.md").write_text("\n\n".join(["# Home", *mistakes]))
    done = build(project, tmp_path)
    assert done.returncode != 0
    for number, message in enumerate(mistakes.values()):
        place = f"README.md:{3 + 2 * number}: "
        assert any(place in line and message in line for line in done.stderr.splitlines())
