"""Pages for the files and folders that the documents link to, so that the site is whole alone.

A link to a module whose text is a name of it in code form leads to that name: to its place in the
API where it has one, else to its line.
"""

from __future__ import annotations

import ast
import importlib
import shutil
from collections.abc import Iterator
from functools import cache, partial
from html import escape
from pathlib import Path
from typing import Any

from docutils import nodes
from pygments.lexers import get_lexer_for_filename
from pygments.util import ClassNotFound
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.builders.html import StandaloneHTMLBuilder
from sphinx.config import Config
from sphinx.transforms import SphinxTransform
from sphinx.util.osutil import relative_uri

ROOT = Path(__file__).parents[3]
FOLDER = "source"
LINKED = "linked_file"
IMAGES = {".png", ".svg", ".gif", ".jpg", ".webp"}
ARRAYS = {".npz", ".safetensors"}
MOST_BYTES = 300_000
"""Longer files are copied and not shown."""


class LinkedFiles(SphinxTransform):
    """Note which links lead to files of the project that are no documents."""

    default_priority = 400

    def apply(self, **kwargs: Any) -> None:
        """Put a reference in the place of each such link."""
        found = [
            *self.document.findall(addnodes.download_reference),
            *self.document.findall(addnodes.pending_xref),
        ]
        for link in found:
            if link.get("reftype") != "myst" or link.get("refdomain"):
                continue
            path = Path(self.env.relfn2path(link["reftarget"], self.env.docname)[1])
            if path.is_file() or path.is_dir():
                inside = str(path.relative_to(ROOT))
                link.replace_self(nodes.reference("", "", *link[0].children, **{LINKED: inside}))


@cache
def lines_of(path: Path) -> dict[str, int]:
    """Return the line of each name that a module defines, with those of its classes."""
    found: dict[str, int] = {}

    def visit(body: list[ast.stmt], prefix: str) -> None:
        for node in body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                found[prefix + node.name] = node.lineno
                if isinstance(node, ast.ClassDef):
                    visit(node.body, f"{prefix}{node.name}.")
            targets = node.targets if isinstance(node, ast.Assign) else []
            if isinstance(node, ast.AnnAssign):
                targets = [node.target]
            for target in targets:
                if isinstance(target, ast.Name):
                    found[prefix + target.id] = node.lineno

    visit(ast.parse(path.read_text("utf-8")).body, "")
    return found


def module_of(path: str) -> str:
    """Return the name of the module in a file."""
    return ".".join(Path(path).with_suffix("").parts).removeprefix("src.").removesuffix(".__init__")


def source_of(domain: str, info: dict[str, str]) -> str | None:
    """Return where a documented object is defined, as seen from docs/api/ (for linkcode)."""
    if domain != "py" or not info["module"]:
        return None
    module, name = info["module"], info["fullname"]
    # A name of the public API is defined in another module.
    public = getattr(importlib.import_module(module), name.partition(".")[0], None)
    module = getattr(public, "__module__", None) or module
    if not module.startswith("nbv"):
        module = info["module"]
    origin = importlib.import_module(module).__file__
    if origin is None:
        return None
    line = lines_of(Path(origin)).get(name)
    if line is None:
        return None
    return f"../../{FOLDER}/{Path(origin).relative_to(ROOT)}.html#L-{line}"


def _address(path: str) -> str:
    """Return where the page, or the copy, of a file or folder lies on the site."""
    place = ROOT / path
    if place.is_dir():
        return f"{FOLDER}/{path}/index.html"
    return f"{FOLDER}/{path}" if _is_copied(place) else f"{FOLDER}/{path}.html"


def _is_copied(place: Path) -> bool:
    return place.suffix in IMAGES | ARRAYS or place.stat().st_size > MOST_BYTES


def _named(link: nodes.reference, app: Sphinx) -> tuple[str, str] | None:
    """Return the page and the anchor of the name that a link to a module gives."""
    path = link[LINKED]
    only = link.children[0] if len(link.children) == 1 else None
    if not path.endswith(".py") or not isinstance(only, nodes.literal):
        return None
    name = only.astext()
    objects = app.env.domains.python_domain.objects
    entry = objects.get(f"{module_of(path)}.{name}")
    if entry is not None:
        return app.builder.get_target_uri(entry.docname), entry.node_id
    line = lines_of(ROOT / path).get(name)
    return None if line is None else (_address(path), f"L-{line}")


def _resolve(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Give the links their addresses."""
    here = app.builder.get_target_uri(page)
    for link in doctree.findall(nodes.reference):
        if LINKED in link:
            address, anchor = _named(link, app) or (_address(link[LINKED]), "")
            link["refuri"] = relative_uri(here, address) + (f"#{anchor}" if anchor else "")
            link["internal"] = True


def _files(folder: Path) -> list[Path]:
    return sorted(
        path
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and not path.name.startswith(".")
    )


def _needed(app: Sphinx) -> tuple[set[Path], set[Path]]:
    """Return the files and the folders that the documents and the API lead to."""
    linked = {
        ROOT / link[LINKED]
        for page in app.env.found_docs
        for link in app.env.get_doctree(page).findall(nodes.reference)
        if LINKED in link
    }
    folders = {path for path in linked if path.is_dir()}
    files = {path for path in linked if path.is_file()}
    files |= {path for folder in folders for path in _files(folder)}
    for name in app.env.domains.python_domain.objects:
        parts = name.split(".")
        for length in range(1, len(parts) + 1):
            module = ROOT.joinpath("src", *parts[:length])
            files |= {
                path
                for path in (module.with_suffix(".py"), module / "__init__.py")
                if path.is_file()
            }
    return files, folders


def _summary(path: Path) -> str:
    """Return the first line of a module's docstring."""
    if path.suffix != ".py":
        return ""
    text = ast.get_docstring(ast.parse(path.read_text("utf-8"))) or ""
    return text.partition("\n")[0]


def _listed(app: Sphinx, here: str, path: Path) -> str:
    """Return an entry of a folder's page."""
    inside = str(path.relative_to(ROOT))
    page = app.env.path2doc(path)
    if page in app.env.found_docs:
        uri = relative_uri(here, app.builder.get_target_uri(page))
        return f'<a href="{escape(uri)}">{escape(app.env.titles[page].astext())}</a>'
    uri = escape(relative_uri(here, _address(inside)))
    if path.suffix in IMAGES:
        return f'<a href="{uri}"><img src="{uri}" alt="{escape(path.stem)}" loading="lazy"></a>'
    summary = _summary(path)
    return f'<a href="{uri}"><code>{escape(path.name)}</code></a> {escape(summary)}'


def _folder_page(app: Sphinx, folder: Path, page: str) -> str:
    """Return the body of a folder's page: its files by folder."""
    here = app.builder.get_target_uri(page)
    body = [f"<h1><code>{escape(str(folder.relative_to(ROOT)))}</code></h1>"]
    files = _files(folder)
    for place in sorted({path.parent for path in files}):
        if place != folder:
            body.append(f"<h2><code>{escape(str(place.relative_to(folder)))}</code></h2>")
        entries = (_listed(app, here, path) for path in files if path.parent == place)
        body.append("<ul>" + "".join(f"<li>{entry}</li>" for entry in entries) + "</ul>")
    return "\n".join(body)


def _language(path: Path) -> str:
    try:
        return str(get_lexer_for_filename(path.name).aliases[0])
    except (ClassNotFound, IndexError):
        return "python" if path.name == "Snakefile" or path.suffix == ".smk" else "text"


def _pages(app: Sphinx) -> Iterator[tuple[str, dict[str, Any], str]]:
    """Yield a page for each file and folder that is needed; copy what is no text."""
    builder = app.builder
    if not isinstance(builder, StandaloneHTMLBuilder):
        return
    files, folders = _needed(app)
    for folder in sorted(folders):
        page = f"{FOLDER}/{folder.relative_to(ROOT)}/index"
        title = str(folder.relative_to(ROOT))
        yield page, {"title": title, "body": _folder_page(app, folder, page)}, "page.html"
    for path in sorted(files):
        inside = str(path.relative_to(ROOT))
        if _is_copied(path):
            copy = Path(app.outdir, FOLDER, inside)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copy)
            continue
        shown = builder.highlighter.highlight_block(
            path.read_text("utf-8"), _language(path), linenos="inline", lineanchors="L"
        )
        body = f"<h1><code>{escape(inside)}</code></h1>\n{shown}"
        yield f"{FOLDER}/{inside}", {"title": inside, "body": body}, "page.html"


def _navigate_once(
    known: dict[tuple[Any, ...], str],
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Share the navigation among the files of a folder: it is the same, and slow to make."""
    if page.startswith(f"{FOLDER}/"):
        make = context["toctree"]

        def toctree(**options: Any) -> str:
            key = (page.rpartition("/")[0], *sorted(options.items()))
            if key not in known:
                known[key] = str(make(**options))
            return known[key]

        context["toctree"] = toctree


def _tell_linkcode(app: Sphinx, config: Config) -> None:
    config["linkcode_resolve"] = source_of


def setup(app: Sphinx) -> dict[str, Any]:
    """Follow links to files of the project."""
    app.add_transform(LinkedFiles)
    app.connect("config-inited", _tell_linkcode)
    app.connect("doctree-resolved", _resolve)
    app.connect("html-collect-pages", _pages)
    app.connect("html-page-context", partial(_navigate_once, {}), priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
