"""Documents: their links, and the files and names that they give."""

import ast
import pkgutil
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from PIL import Image

import nbv

ROOT = Path(__file__).parents[2]
NOT_OURS = {"results", "build", "mutants"}
DOCUMENTS = sorted(
    path
    for part in ROOT.iterdir()
    if part.name not in NOT_OURS and not part.name.startswith(".")
    for path in ([part] if part.suffix == ".md" else part.rglob("*.md"))
)
PAGES = [path for path in DOCUMENTS if path.name == "README.md" or "reference" not in path.parts]

TREES = ("src", "studies", "workflow", "config", "docs", "tests", "performance", "tools")
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
    places = r"\b(?:src/nbv|config|tests|tools)/[\w/]+(?:\.\w+)?"
    named = re.findall(places, path.read_text("utf-8"))
    assert not [name for name in set(named) if not (ROOT / name).exists()]


@pytest.mark.parametrize("name", ["docs/drivers.md", "docs/five-minutes.md"])
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
    assert commands == ["sh", "make quick", "make test"]


def test_the_tables_of_numbers_are_those_of_the_reference() -> None:
    command = [sys.executable, ROOT / "tools/tables.py", "--check"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_everything_that_the_paper_numbers_has_its_place() -> None:
    text = (ROOT / "docs/paper.md").read_text("utf-8")
    placed = re.findall(r"^\| ((?:Eq\.|Fig\.|Table) \d+) \|", text, re.MULTILINE)
    numbered = (("Eq.", 10), ("Table", 7), ("Fig.", 9))
    assert placed == [f"{kind} {n}" for kind, count in numbered for n in range(1, count + 1)]


def test_every_name_of_the_package_that_a_text_gives_exists() -> None:
    """Every dotted name in code form can be imported, in docstrings, comments and documents."""
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
