"""A real browser without a network, and the pages of a finished run."""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from projects import TINY, Project

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, Request

Visit = Callable[..., "Page"]

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
# The elevations of the run are the page's too; one category has two.
TALL = (*(one for one in TINY if not one.startswith("elevations")), "elevations_deg.mug=[0,30]")
LONGEST_WAIT_MS = 60_000


def missing() -> str | None:
    """Say in one line what the tests lack here; None where they lack nothing."""
    if importlib.util.find_spec("playwright") is None:
        return "no playwright: install requirements.lock (make test-browser)"
    if not any(map(shutil.which, BROWSERS)):
        return "no chromium: install Debian's chromium (make test-browser)"
    return None


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """The machine's own Chromium; nothing is downloaded."""
    if (reason := missing()) is not None:
        pytest.skip(reason)
    from playwright.sync_api import sync_playwright

    path = next(filter(None, map(shutil.which, BROWSERS)))
    # Chromium's sandbox refuses to start as root.
    options = ["--no-sandbox"] if os.geteuid() == 0 else []
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=path, args=options)
        yield started
        started.close()


@pytest.fixture
def visit(browser: Browser) -> Iterator[Visit]:
    """Open a page of a file, cut off from all networks; it must ask for nothing and log no error.

    ``visit(path, fragment="", width=1280, **options)``; the options are of a browser context. A
    page that marks itself with ``data-state`` is waited for.
    """
    contexts, wrong = [], []

    def asked(request: Request) -> None:
        if not request.url.startswith(("file:", "data:", "blob:")):
            wrong.append(f"asked for {request.url}")

    def opened(path: Path, fragment: str = "", width: int = 1280, **options: Any) -> Page:
        context = browser.new_context(viewport={"width": width, "height": 844}, **options)
        contexts.append(context)
        context.set_default_timeout(LONGEST_WAIT_MS)
        context.set_offline(True)
        page = context.new_page()
        page.on("console", lambda said: said.type == "error" and wrong.append(said.text))
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", asked)
        page.goto(path.as_uri() + (f"#{fragment}" if fragment else ""))
        page.wait_for_selector("html:not([data-state=loading])")
        return page

    yield opened
    for context in contexts:
        context.close()
    assert not wrong


@pytest.fixture(scope="session")
def explored(
    browser: Browser, finished: Project, tmp_path_factory: pytest.TempPathFactory
) -> Project:
    """A copy of the finished project with mugs at two elevations and its explorer."""
    folder = tmp_path_factory.mktemp("explored") / "project"
    shutil.copytree(finished.folder, folder, symlinks=True)
    project = Project(folder)
    project.run("--cores", "2", "explorer", overrides=TALL)
    return project
