"""The report in a real browser: it opens without a network, fits, and can be read by everybody."""

from itertools import pairwise
from pathlib import Path

import pytest

from nbv.experiment.plan import too_small
from nbv.experiment.report.figures.build import build_figure
from nbv.experiment.report.page import build_report
from nbv.experiment.report.tables import TABLES
from reports import figure_inputs, report_files

WIDTHS = (390, 768, 1280)
# The edges of the first two cells of a table's rows, and how far its box can be scrolled.
CELLS = """box => {
    const row = box.querySelector('tbody tr');
    box.scrollLeft = 10000;
    const [first, second] = [...row.children].map(cell => cell.getBoundingClientRect());
    const place = box.getBoundingClientRect();
    return {scrolled: box.scrollLeft, left: first.left - place.left,
            second: second.left - place.left,
            paper: getComputedStyle(row.children[0]).backgroundColor};
}"""
# Text that is cut off or drawn over other text inside a drawing.
OVERLAPS = """drawing => {
    const boxes = [...drawing.querySelectorAll('text')].filter(text => text.textContent.trim())
        .map(text => [text.textContent, text.getBoundingClientRect()]);
    const edge = drawing.getBoundingClientRect(), wrong = [];
    for (const [name, box] of boxes)
        if (box.left < edge.left - 2 || box.right > edge.right + 2)
            wrong.push(name + ' is cut off');
    for (let i = 0; i < boxes.length; i++) for (let j = 0; j < i; j++) {
        const [a, b] = [boxes[i][1], boxes[j][1]];
        const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
        const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
        if (wide > 3 && high > 5) wrong.push(boxes[i][0] + ' over ' + boxes[j][0]);
    }
    return wrong;
}"""


@pytest.fixture(scope="session")
def path(tree, evaluations, tmp_path_factory) -> Path:
    """The report of the synthetic results tree, with everything on it."""
    root, inputs = tmp_path_factory.mktemp("report"), figure_inputs(tree, evaluations)
    files = report_files(root, tree, evaluations, lambda name: build_figure(name, inputs))
    page = build_report(**files, caution=too_small({"mug": 9}, 8))
    (root / "report.html").write_text(page, encoding="utf-8")
    return root / "report.html"


@pytest.mark.parametrize("width", WIDTHS)
def test_it_fits_and_logs_no_error(visit, path, width):
    page = visit(path, width=width)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    page.evaluate("document.querySelectorAll('details').forEach(fold => fold.open = true)")
    assert page.evaluate("document.documentElement.scrollWidth") == width


def test_it_works_where_scripts_are_forbidden(visit, path):
    page = visit(path, java_script_enabled=False)
    page.locator("summary", has_text="Numbers").first.click()
    assert page.locator("article table").first.is_visible()


def test_the_first_screen_holds_the_finding_and_all_three_pictures(visit, path):
    page = visit(path)
    for name in ("table1-picture", "claims-forest", "steps"):
        box = page.locator(f"#{name} svg").bounding_box()
        assert box["y"] + box["height"] < 844
    assert page.locator(".finding").bounding_box()["y"] < 200


@pytest.mark.parametrize("width", WIDTHS)
def test_text_in_the_pictures_is_large_enough_and_free(visit, path, width):
    page = visit(path, width=width)
    for drawing in page.locator(".opening svg, .claim figure svg").all():
        if not drawing.is_visible():
            continue
        assert drawing.evaluate(OVERLAPS) == []
        sizes = (
            "one => [...one.querySelectorAll('text')].map(t => t.getBoundingClientRect().height)"
        )
        tall = [size for size in drawing.evaluate(sizes) if size]
        assert min(tall) >= 9


def test_tables_scroll_in_their_own_box_and_keep_the_first_column(visit, path):
    page = visit(path, width=390)
    boxes = page.locator("#tables .scroll").all()
    assert len(boxes) == len(TABLES)
    for box in boxes:
        found = box.evaluate(CELLS)
        assert found["scrolled"] > 20
        assert abs(found["left"]) < 1
        assert found["second"] < 130
        assert found["paper"] != "rgba(0, 0, 0, 0)"


def test_narrow_tables_show_proposed_first_and_that_there_is_more(visit, path):
    page = visit(path, width=390)
    for box in page.locator("#tables .scroll").all():
        place = box.bounding_box()
        column = box.locator("td.in-sight").first.bounding_box()
        assert column["x"] + column["width"] <= place["x"] + place["width"] + 1
        first = box.locator("tbody th").first.bounding_box()
        assert column["x"] > first["x"] + first["width"]
        hint = box.evaluate("one => getComputedStyle(one, '::before').content")
        assert "more" in hint
    wide = visit(path).locator("#table1 .scroll")
    assert wide.evaluate("one => getComputedStyle(one, '::before').content") == "none"


def test_no_word_of_a_heading_breaks(visit, path):
    broken = """all => all.filter(cell => {
        const text = cell.firstChild, range = document.createRange();
        return [...text.data.matchAll(/\\p{L}+/gu)].some(word => {
            range.setStart(text, word.index);
            range.setEnd(text, word.index + word[0].length);
            return range.getClientRects().length > 1;
        });
    }).map(cell => cell.textContent)"""
    page = visit(path, width=390)
    assert page.locator("#tables thead th").evaluate_all(broken) == []


def test_one_button_opens_every_claim_and_is_absent_where_scripts_are_forbidden(visit, path):
    page = visit(path)
    page.get_by_role("button").click()
    assert page.locator("#claims details:not([open])").count() == 0
    assert visit(path, java_script_enabled=False).locator("button").is_hidden()


def test_the_keyboard_goes_from_top_to_bottom_and_scrolls_tables(visit, path):
    page = visit(path, width=390)
    focus = "(e => [e.className, e.getBoundingClientRect().top + scrollY])(document.activeElement)"
    places = []
    for _ in range(25):
        page.keyboard.press("Tab")
        places.append(page.evaluate(focus))
    assert places[0][0] == "skip"
    tops = [top for _, top in places[1:]]
    assert all(later >= earlier - 30 for earlier, later in pairwise(tops))
    box = page.locator("#tables .scroll").first
    box.focus()
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    page.wait_for_timeout(300)
    assert box.evaluate("one => one.scrollLeft") > 0


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1280])
def test_axe_finds_nothing_inaccessible(visit, path, width, scheme):
    from axe_playwright_python.sync_playwright import Axe

    page = visit(path, width=width, color_scheme=scheme)
    page.evaluate("document.querySelectorAll('details').forEach(fold => fold.open = true)")
    found = Axe().run(page).response["violations"]
    assert [(one["id"], [node["html"][:120] for node in one["nodes"][:3]]) for one in found] == []


def test_dark_paper_is_dark_and_its_ink_light(visit, path):
    colors = "[getComputedStyle(document.body), getComputedStyle(document.querySelector('svg'))]"
    for scheme, is_dark in (("light", False), ("dark", True)):
        page = visit(path, color_scheme=scheme)
        paper, ink = page.evaluate(f"(([b, s]) => [b.backgroundColor, s.fill])({colors})")
        levels = [int(one.strip("rgb()").split(",")[0]) for one in (paper, ink)]
        assert (levels[0] < levels[1]) == is_dark


def test_a_run_that_is_too_small_says_so_at_the_top(visit, path):
    page = visit(path, width=390)
    note = page.locator(".caution")
    assert "too small" in note.inner_text()
    assert note.bounding_box()["y"] < 300
