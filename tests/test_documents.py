"""Documents: their links, and the files and names that they give."""

import ast
import pkgutil
import re
from collections import Counter
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image

import nbv

ROOT = Path(__file__).parents[1]
NOT_OURS = {"results", "build", "mutants"}
DOCUMENTS = sorted(
    path
    for part in ROOT.iterdir()
    if part.name not in NOT_OURS and not part.name.startswith(".")
    for path in ([part] if part.suffix == ".md" else part.rglob("*.md"))
)
PAGES = [path for path in DOCUMENTS if path.name == "README.md" or "reference" not in path.parts]

TERMS = (
    *("warm start", "affinity", "choice", "plan", "shuffle", "density", "embedded objects", "fold"),
    *("viewpoint", "pose", "view", "estimate", "rotation δ", "calibration pair", "conditional"),
    *("evidence", "belief", "criterion", "cost", "policy", "fusion", "method", "extension", "unit"),
    *(
        "frame",
        "bundle",
        "reach",
        "mirror plane",
        "calibration sweep",
        "recording",
        "offset",
        "expected error",
        "out-of-distribution score",
    ),
    *("spread", "single"),
)

# Each pattern with the word that takes its place. An underscore separates words, and so does a
# capital within a name.
BANNED = {
    r"\bcontend\w*": "extension; evaluate, compare",
    r"\bcontest\w*": "extensions; evaluate",
    r"\bbesides?\b": "compared_runs; next to, with",
    r"\bstanding\b": "mae_interval; is, lies",
    r"\bsheets?\b": "table",
    r"\blooks\b": "views; takes a view, seems",
    r"\b(?:a|one|two|each|every|another|first|second|next|more)\s+look\b": "view",
    r"\blook\s+again\b": "take another view",
    r"\bworths?\b": "cost; what it brings",
    r"\blent\b": "given, shared",
    r"\breadings\b": "interpretations; measurements, depth values",
    r"\b(?:an?|the|its|this|which|each|one|other|nearest)\s+reading\b": "interpretation; value",
    r"\breading\s+settings\b": "ReportSettings",
    r"(?<![\"'`])[\"'`.]reading\b|\breading=|\breading: str": "pose_likelihood",
    r"\bh(?:eld|olds?|olding)(?:\s+\w+){0,4}\s+against\b": "compare with",
    r"\bsidebyside\b": "run_comparison",
    r"(?<=[/\"'`])beyond\b|\bbeyond(?=[/\"'`(=]|\.\w)": "extensions, extension_gains",
    r"\bbeyond\s+the\s+paper\b": "extension",
}
# What is said only to define "extension".
ALLOWED = {
    "docs/glossary.md": ("beyond the paper",),
    "docs/reference/extensions/README.md": ("docs/reference/beyond",),
}
TREES = ("src", "workflow", "config", "docs", "tests", "performance", "profiles")
SUFFIXES = {".py", ".smk", ".yaml", ".md", ".rst", ".j2", ".css", ".js", ".html"}


def without_code(text: str) -> str:
    return re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)


def anchors(path: Path) -> set[str]:
    """Return the anchors that GitHub gives the headings of a document."""
    headings = re.findall(r"^#+ (.+)$", without_code(path.read_text("utf-8")), re.MULTILINE)
    found: set[str] = set()
    seen: Counter[str] = Counter()
    for heading in headings:
        plain = re.sub(r"\]\([^)]*\)", "", heading).lower()
        anchor = re.sub(r"[^\w\- ]", "", plain).replace(" ", "-")
        found.add(f"{anchor}-{seen[anchor]}" if seen[anchor] else anchor)
        seen[anchor] += 1
    return found


def links(path: Path) -> list[str]:
    """Return the links and images of a document that lead into the repository."""
    text = without_code(path.read_text("utf-8"))
    found = re.findall(r"\]\(([^)\s]+)\)", text)
    found += re.findall(r"^\[[^\]]+\]:\s+(\S+)", text, re.MULTILINE)
    found += re.findall(r"<(?:a|img|source)\b[^>]*?\b(?:href|src|srcset)=\"([^\"]+)\"", text)
    return [link for link in found if not re.match(r"[a-z]+:", link)]


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(path: Path) -> None:
    broken = []
    for link in links(path):
        name, _, anchor = link.partition("#")
        target = (path.parent / name).resolve() if name else path
        if not target.exists() or (anchor and anchor not in anchors(target)):
            broken.append(link)
        elif target.suffix in {".png", ".gif", ".jpg", ".webp"}:
            with Image.open(target) as image:
                image.verify()
    assert not broken


def defined(module: Path) -> set[str]:
    """Return the names that a module defines at its top."""
    found = set()
    for node in ast.parse(module.read_text("utf-8")).body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", node)]
        found |= {getattr(one, "name", getattr(one, "id", "")) for one in targets}
    return found - {""}


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_name_that_links_to_a_module_is_defined_there(path: Path) -> None:
    text = without_code(path.read_text("utf-8"))
    missing = [
        f"{name} in {module}"
        for name, module in re.findall(r"\[`(\w+)`\]\(([^)\s]+\.py)\)", text)
        if name not in defined(path.parent / module)
    ]
    assert not missing


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_source_files_that_a_document_names_exist(path: Path) -> None:
    example = "src/nbv/recommendation/criteria/sharpest.py"
    named = re.findall(r"\b(?:src/nbv|config|tests)/[\w/]+(?:\.\w+)?", path.read_text("utf-8"))
    assert not [name for name in set(named) - {example} if not (ROOT / name).exists()]


@pytest.mark.parametrize("name", ["README.md", "docs/camera.md", "docs/five-minutes.md"])
def test_the_python_of_a_document_takes_public_names_alone(name: str) -> None:
    text = (ROOT / name).read_text("utf-8")
    snippets = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    assert snippets
    for snippet in snippets:
        used = {
            node.attr
            for node in ast.walk(ast.parse(snippet))
            if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "nbv"
        }
        assert used
        assert used <= set(nbv.__all__)


def test_the_readme_begins_with_the_two_commands() -> None:
    first_block = (ROOT / "README.md").read_text("utf-8").split("```")[1]
    commands = [line.split("  ")[0] for line in first_block.splitlines()]
    assert commands == ["sh", "make reproduce", "make test"]


def test_the_readme_has_table_1_of_the_reference_run() -> None:
    cells = pd.read_csv(ROOT / "docs/reference/paper/tables/table1.csv")
    expected = []
    for label, row in cells[cells["metric"] == "mae"].groupby("row_label", sort=False):
        least = row["value"].min()
        shown = [
            f"{f'**{value:.2f}**' if value == least else f'{value:.2f}'} [{published:.2f}]"
            for value, published in zip(row["value"], row["published"], strict=True)
        ]
        expected.append(f"| {label} | {' | '.join(shown)} |")
    text = (ROOT / "README.md").read_text("utf-8")
    assert re.findall(r"^\| [A-Z]\w+ \|.*\]\s\|$", text, re.MULTILINE) == expected


def test_everything_that_the_paper_numbers_has_its_place() -> None:
    text = (ROOT / "docs/paper.md").read_text("utf-8")
    placed = re.findall(r"^\| ((?:Eq\.|Fig\.|Table) \d+) \|", text, re.MULTILINE)
    numbered = (("Eq.", 10), ("Table", 7), ("Fig.", 9))
    assert placed == [f"{kind} {n}" for kind, count in numbered for n in range(1, count + 1)]


def test_every_name_of_the_package_that_a_text_gives_exists() -> None:
    """`nbv.module.name` in docstrings, comments and documents leads somewhere."""
    texts = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    texts += [path for tree in TREES for path in sorted((ROOT / tree).rglob("*"))]
    missing = []
    for path in texts:
        if path.suffix not in SUFFIXES:
            continue
        for name in set(re.findall(r"`(nbv(?:\.\w+)+)`", path.read_text("utf-8"))):
            try:
                pkgutil.resolve_name(name)
            except (ImportError, AttributeError):
                missing.append(f"{path.relative_to(ROOT)}: {name}")
    assert not missing, missing
