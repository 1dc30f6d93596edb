"""Documents: their links, the files they name, the glossary, and words that have a better one."""

import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCUMENTS = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
PAGES = [path for path in DOCUMENTS if path.name == "README.md" or "reference" not in path.parts]

TERMS = (
    *("warm start", "affinity", "choice", "plan", "shuffle"),
    *("viewpoint", "pose", "view", "estimate", "rotation δ", "calibration pair", "conditional"),
    *("evidence", "belief", "criterion", "cost", "policy", "fusion", "method", "extension", "unit"),
    *("frame", "bundle", "calibration turn", "recording", "expected error", "unfamiliarity"),
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
# What is said only to define "extension", and the tables of renamed keys and old names.
ALLOWED = {
    "docs/glossary.md": ("beyond the paper",),
    "docs/reference/extensions/README.md": ("docs/reference/beyond",),
    "src/nbv/config/schema.py": ('"contenders"', '"beside"', '"reading"'),
    # Tests of the messages that name the new key.
    "tests/test_config.py": ("contenders", "beside", ".reading", '"reading"'),
    "tests/workflow/test_messages.py": ("contenders",),
}
TREES = ("src", "workflow", "config", "docs", "tests", "performance", "profiles")
SUFFIXES = {".py", ".smk", ".yaml", ".md", ".j2", ".css", ".js", ".html"}


def without_code(text: str) -> str:
    return re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)


def anchors(path: Path) -> set[str]:
    """Return the anchors that GitHub gives the headings of a document."""
    headings = re.findall(r"^#+ (.+)$", without_code(path.read_text("utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def links(path: Path) -> list[str]:
    text = without_code(path.read_text("utf-8"))
    return [link for link in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in link]


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(path: Path) -> None:
    broken = []
    for link in links(path):
        name, _, anchor = link.partition("#")
        target = (path.parent / name).resolve() if name else path
        if not target.exists() or (anchor and anchor not in anchors(target)):
            broken.append(link)
    assert not broken


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_source_files_that_a_document_names_exist(path: Path) -> None:
    example = "src/nbv/recommendation/criteria/sharpest.py"
    named = re.findall(r"\b(?:src/nbv|config|tests)/[\w/]+(?:\.\w+)?", path.read_text("utf-8"))
    assert not [name for name in set(named) - {example} if not (ROOT / name).exists()]


def test_the_readme_begins_with_the_two_commands() -> None:
    first_block = (ROOT / "README.md").read_text("utf-8").split("```")[1]
    commands = [line.split("  ")[0] for line in first_block.splitlines()]
    assert commands == ["sh", "make reproduce", "make test"]


def test_the_glossary_defines_each_term_once() -> None:
    text = (ROOT / "docs/glossary.md").read_text("utf-8")
    defined = [term.lower() for term in re.findall(r"^\*\*(.+?)\*\*", text, re.MULTILINE)]
    assert sorted(defined) == sorted(TERMS)


def scanned() -> Iterator[Path]:
    yield from (ROOT / name for name in ("README.md", "CONTRIBUTING.md", "Snakefile", "Makefile"))
    for tree in TREES:
        for path in sorted((ROOT / tree).rglob("*")):
            # Tables and configurations that a run left are kept as they were made.
            kept = "reference" in path.parts and "docs" in path.parts and path.name != "README.md"
            if path.suffix in SUFFIXES and not kept and path != Path(__file__):
                yield path


def spaced(text: str) -> str:
    """Return text with the words of its names apart."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text).replace("_", " ")


def test_no_banned_word_is_left() -> None:
    found = []
    for path in scanned():
        name = str(path.relative_to(ROOT))
        text = path.read_text("utf-8")
        for words in ALLOWED.get(name, ()):
            text = text.replace(words, "")
        # The name itself first, as a line 0.
        text = f"{spaced(name)}\n{spaced(text)}"
        for pattern, better in BANNED.items():
            for match in re.finditer(pattern, text, re.IGNORECASE):
                line = text.count("\n", 0, match.start())
                found.append(f"{name}:{line}: {match[0]!r}; say {better}")
    assert not found, "\n".join(["", *found])


def test_every_name_of_the_package_that_a_text_gives_exists() -> None:
    """`nbv.module.name` in docstrings, comments and documents leads somewhere."""
    missing = []
    for path in scanned():
        if path.suffix not in {".py", ".smk", ".md", ".yaml"} or "tests" in path.parts:
            continue
        for name in set(re.findall(r"`(nbv(?:\.\w+)+)`", path.read_text("utf-8"))):
            try:
                pkgutil.resolve_name(name)
            except (ImportError, AttributeError):
                missing.append(f"{path.relative_to(ROOT)}: {name}")
    assert not missing, missing
