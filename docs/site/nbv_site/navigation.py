"""The order of the pages. The Markdown files have none, so that a Git host shows them well."""

from __future__ import annotations

import shutil
from pathlib import Path, PurePosixPath
from typing import Any

from sphinx.application import Sphinx

HOME = "README"
RESULTS = "docs/reference"
SECTIONS = {
    "Use it": (
        "docs/five-minutes",
        "docs/camera",
        "docs/drivers",
        "docs/your-estimator",
        "docs/own-category",
        "docs/bundles",
    ),
    "Understand it": ("docs/method", "docs/paper"),
    "Run it": ("docs/guide", "config/README", "studies/README", "docs/data", "docs/scale"),
    "Results": (f"{RESULTS}/README",),
    "Change it": (
        "docs/extending",
        "docs/architecture",
        "docs/api/index",
        "CONTRIBUTING",
        "CODE_OF_CONDUCT",
        "SECURITY",
        "CHANGELOG",
    ),
}


def _toctree(pages: list[str], caption: str = "") -> str:
    entries = "\n".join(f"/{page}" for page in pages)
    options = f":hidden:\n:caption: {caption}\n" if caption else ":hidden:\n"
    return f"\n```{{toctree}}\n{options}\n{entries}\n```\n"


def _unlisted(app: Sphinx) -> list[str]:
    """Return the pages directly in docs/ that no section names: a new page is never lost."""
    listed = {page for pages in SECTIONS.values() for page in pages}
    return sorted(
        page
        for page in app.project.docnames
        if PurePosixPath(page).parent == PurePosixPath("docs") and page not in listed
    )


def _below(page: str, app: Sphinx) -> list[str]:
    """Return the other overviews of results whose nearest overview is this page."""
    overviews = {
        PurePosixPath(name).parent
        for name in app.project.docnames
        if name.startswith(f"{RESULTS}/") and name.endswith("/README")
    }
    here = PurePosixPath(page).parent
    nearest = {
        folder: next((above for above in folder.parents if above in overviews), None)
        for folder in overviews
    }
    return [f"{folder}/README" for folder, above in sorted(nearest.items()) if above == here]


def _add(app: Sphinx, page: str, source: list[str]) -> None:
    """Add to a page's text where it stands among the others."""
    if page == HOME:
        for caption, pages in SECTIONS.items():
            source[0] += _toctree(list(pages), caption)
        if more := _unlisted(app):
            source[0] += _toctree(more, "More")
    elif page.startswith(f"{RESULTS}/") and page.endswith("/README"):
        if below := _below(page, app):
            source[0] += _toctree(below)
    elif page.startswith(f"{RESULTS}/"):
        source[0] = f"---\norphan: true\n---\n\n{source[0]}"


def _home(app: Sphinx, failed: Exception | None) -> None:
    if failed is None and app.builder.name == "html":
        folder = Path(app.outdir)
        shutil.copyfile(folder / f"{HOME}.html", folder / "index.html")


def setup(app: Sphinx) -> dict[str, Any]:
    """Add the navigation to the pages as they are read."""
    app.connect("source-read", _add)
    app.connect("build-finished", _home)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
