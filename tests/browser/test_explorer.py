"""The explorer in a real browser: what it shows is what the run's files say."""

import re
from itertools import product
from urllib.parse import parse_qs, urlencode, urlsplit

import numpy as np
import pandas as pd
import pytest
from studies.simulation import bisecting_next, coarser, recommended_next, updated

import synthetic
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.belief import first_belief
from nbv.core.circle.criteria import CRITERIA
from nbv.core.circle.density import Conditionals
from nbv.core.circle.distributions import FLAT, mean_direction_deg
from nbv.core.circle.estimates import posteriors_of
from nbv.core.circle.evidence import Evidence
from nbv.experiment.estimates import write_posteriors
from nbv.experiment.explorer import build_explorer
from nbv.experiment.explorer.data import page_table
from nbv.tables.lookup import LookupTable
from reports import explorer_inputs

METHODS = synthetic.METHODS
WIDTHS = (390, 768, 1280)
APART_DEG = 15


@pytest.fixture(scope="session")
def path(explored):
    return explored.results / "explorer.html"


@pytest.fixture(scope="session")
def outcomes(explored):
    """All evaluation files, a row for each unit, object, first view and method."""
    frames = []
    for (category, elevation), fold, method in product(synthetic.UNITS, (1, 2), METHODS):
        unit = f"{category}/el{elevation:02d}"
        frame = pd.read_csv(explored.results / f"evaluation/{unit}/fold{fold}/{method}.csv")
        place = {"category": category, "elevation": elevation, "fold": fold, "method": method}
        frames.append(frame.assign(**place))
    keys = ["category", "elevation", "object_id", "initial_deg", "method"]
    return pd.concat(frames).set_index(keys).sort_index()


def fragment(**state) -> str:
    return urlencode(state)


def state_of(page) -> dict[str, str]:
    """What the page's own permanent link says."""
    return {key: value for key, (value,) in parse_qs(urlsplit(page.url).fragment).items()}


def settle(page) -> None:
    """Wait until the page has drawn, and its link has followed."""
    page.wait_for_selector("html[data-state=ready]")
    page.wait_for_function("new URLSearchParams(location.hash.slice(1)).has('category')")
    page.wait_for_timeout(400)


def go_to(page, **state) -> None:
    page.evaluate(
        "target => { document.documentElement.dataset.state = 'waiting'; location.hash = target; }",
        fragment(**state),
    )
    page.wait_for_selector("html[data-state=ready]")


def cells(page, table: str) -> dict[tuple[str, str], str]:
    """The text of a table's cells by method and column."""
    return {
        tuple(key): text
        for *key, text in page.eval_on_selector_all(
            f"#{table} td",
            "all => all.map(c => [c.parentElement.dataset.method, c.dataset.cell, c.textContent])",
        )
    }


def degrees(text: str) -> float:
    return float(text.replace("\N{MINUS SIGN}", "-").rstrip("°% "))


def is_rounded(text: str, value: float) -> bool:
    """Say whether a text is a number rounded to its last decimal."""
    return (
        abs(degrees(text) - value)
        <= 0.5 * 10.0 ** -len(text.rstrip("°% ").partition(".")[2]) + 1e-9
    )


def random_states(outcomes, n: int, seed: int) -> list[dict[str, object]]:
    rng = np.random.default_rng(seed)
    rows = outcomes.index.droplevel("method").unique()
    names = ("category", "elevation", "object", "azimuth")
    return [
        dict(zip(names, rows[i], strict=True))
        | {"method": str(rng.choice(METHODS)), "views": int(rng.integers(1, 6))}
        for i in rng.choice(len(rows), n, replace=False)
    ]


def errors_of(outcomes, *unit) -> pd.DataFrame:
    """Errors by object and first view, a column for each method."""
    rows = outcomes.loc[unit].reset_index()
    return rows.pivot_table("error_deg", ["object_id", "initial_deg"], "method")


def test_fifty_random_states_show_the_numbers_of_the_files(visit, path, outcomes):
    page = visit(path)
    wrong = []
    for state in random_states(outcomes, 50, seed=0):
        go_to(page, **state)
        place = (state["category"], state["elevation"], state["object"])
        shown, means = cells(page, "outcomes"), cells(page, "overall")
        for method in METHODS:
            row = outcomes.loc[(*place, state["azimuth"], method)]
            expected = {"pose": row["pose_estimate_deg"], "error": row["error_deg"]}
            if method == "single":
                assert {shown[method, "delta"], shown[method, "next"]} == {"–"}
            else:
                expected |= {"delta": row["delta_deg"], "next": row["next_estimate_deg"]}
            wrong += [
                (state, method, column, shown[method, column], value)
                for column, value in expected.items()
                # 359.996 is 0.00 and not 360.00.
                if not is_rounded(shown[method, column], value)
                and not is_rounded(shown[method, column], value - 360.0)
            ]
            of_unit = outcomes.loc[place[:2]].xs(method, level="method")["error_deg"]
            above = of_unit > 90
            expected = {
                "object": of_unit.loc[place[2]].mean(),
                "mean": of_unit.mean(),
                "above": (of_unit * above).mean(),
                "share": 100 * above.mean(),
            }
            wrong += [
                (state, method, column, means[method, column], value)
                for column, value in expected.items()
                if not is_rounded(means[method, column], value)
            ]
    assert not wrong


def test_dragging_round_the_ring_moves_the_first_view_and_nothing_else(visit, path, outcomes):
    page = visit(path, fragment(category="mug", azimuth=0, method="opposite"))
    settle(page)
    before, picture = state_of(page), page.locator("#ring").screenshot()
    ring = page.locator("#ring")
    ring.scroll_into_view_if_needed()
    box = ring.bounding_box()
    centre = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    seen = []
    page.mouse.move(centre[0] + 0.44 * box["width"], centre[1])
    page.mouse.down()
    for azimuth in range(0, 211, 15):
        angle = np.radians(azimuth)
        page.mouse.move(
            centre[0] + 0.44 * box["width"] * np.cos(angle),
            centre[1] - 0.44 * box["width"] * np.sin(angle),
        )
        page.wait_for_function(f"document.getElementById('azimuth-text').value === '{azimuth}°'")
        seen.append(cells(page, "outcomes")["opposite", "error"])
    page.mouse.up()
    page.mouse.move(*centre)
    settle(page)
    assert state_of(page) == before | {"azimuth": "210"}
    assert page.locator("#azimuth").input_value() == "210"
    assert "210°" in page.locator("#view-1 figcaption").inner_text()
    assert "30°" in page.locator("#view-opposite figcaption").inner_text()
    assert page.locator("#ring").screenshot() != picture
    errors = outcomes.loc[("mug", 0, before["object"])].xs("opposite", level="method")["error_deg"]
    assert all(map(is_rounded, seen, errors.loc[range(0, 211, 15)]))


def page_evidence(table) -> tuple[Evidence, Evidence]:
    """What the page knows of a table, in its bins and in fewer, for the package's own functions."""
    logs = page_table(table).logs
    weights = np.exp(logs.low + logs.codes.astype(np.float64) * ((logs.high - logs.low) / 255.0))
    of_fine = weights / weights.sum(axis=1, keepdims=True)
    # Bins of 3°, each about its centre: the mean over viewpoints, the sum over estimates.
    turned = np.roll(of_fine, (1, 1), axis=(0, 1)).reshape(120, 3, 120, 3)
    of_coarse = turned.mean(axis=1).sum(axis=2)
    return tuple(
        Evidence(
            np.empty((0, len(likelihood))),
            Conditionals(likelihood.T / likelihood.sum(axis=0)[:, None], likelihood),
            np.nan,
            np.nan,
            {},
        )
        for likelihood in (of_fine, of_coarse)
    )


@pytest.mark.parametrize("policy", ["gain", "halves"])
def test_five_views_are_those_of_the_packages_own_functions(
    visit, path, outcomes, explored, policy
):
    page = visit(path)
    known = {}
    for state in random_states(outcomes, 12, seed=1):
        state |= {"views": 5, "method": "proposed", "next": policy}
        if policy == "halves":
            state["method"] = "opposite"
        go_to(page, **state)
        place = (state["category"], state["elevation"])
        rows = outcomes.loc[(*place, state["object"])]
        first = rows.loc[(state["azimuth"], state["method"])]
        unit = (*place, int(first["fold"]))
        if unit not in known:
            folder = explored.results / "lookup/{}/el{:02d}/fold{}".format(*unit)
            known[unit] = page_evidence(LookupTable.load(folder / "pose_ambiguity.npz"))
        evidence, coarse = known[unit]
        shown = page.evaluate(
            "(({turns, beliefs}) => [turns, beliefs.map(b => [...b])])(explorer.followed())"
        )
        estimates = rows.xs("single", level="method")["pose_estimate_deg"].round(2)
        turns, beliefs = np.array(shown[0], dtype=np.int64), np.array(shown[1])
        assert turns[1] == first["delta_deg"]
        belief = first_belief(np.array([estimates.loc[state["azimuth"]]]), evidence)
        for view, turn in enumerate(turns):
            taken = turns[None, :view]
            if view:
                estimate = estimates.loc[(state["azimuth"] + turn) % 360]
                if policy == "gain" and view > 1:
                    cost = CRITERIA["information_gain"](coarser(belief, coarse), coarse, "")[0]
                    choose = recommended_next("information_gain", coarse, APART_DEG)
                    best = choose(belief, taken, np.random.default_rng(0))[0]
                    # Of two that cost the same, rounding decides.
                    assert abs(cost[turn // 3] - cost[best // 3]) < 1e-5
                    assert circular_distance_deg(taken, turn).min() >= APART_DEG
                elif policy == "halves":
                    assert turn == bisecting_next(belief, taken, np.random.default_rng(0))[0]
                belief = updated(belief, np.array([estimate]), np.array([turn]), evidence)
            np.testing.assert_allclose(beliefs[view], belief.probabilities[0], atol=2e-6)
            # Of the page's own belief: a nearly even one has no direction.
            mean = float(mean_direction_deg(beliefs[view : view + 1])[0])
            line = page.locator(f"#steps tbody tr:nth-child({view + 1}) td").all_inner_texts()
            if abs(beliefs[view] @ np.exp(1j * np.radians(np.arange(360)))) <= FLAT:
                assert line[3:] == ["–", "–"]
            else:
                assert is_rounded(line[3], mean)
                assert is_rounded(line[4], float(circular_distance_deg(mean, state["azimuth"])))
            densest = np.sort(beliefs[view])[::-1].cumsum()
            assert line[2] == f"{int((densest < 0.9).sum()) + 1}°"


def test_a_permanent_link_restores_what_was_shown(visit, path):
    page = visit(path)
    page.select_option("#category", "mug")
    settle(page)
    page.select_option("#elevation", "30")
    settle(page)
    page.select_option("#object", index=5)
    page.check("[name=method][value=random]")
    page.check("[name=views][value='4']")
    page.select_option("#next", "halves")
    page.locator("#azimuth").fill("123")
    settle(page)
    state = state_of(page)
    chosen = {"category": "mug", "elevation": "30", "azimuth": "123", "method": "random"}
    assert state.items() >= (chosen | {"views": "4", "next": "halves"}).items()
    other = visit(path, urlsplit(page.url).fragment)
    settle(other)
    assert state_of(other) == state
    # Not what was said aloud of the last change.
    shown = "main > :not(#status)"
    assert other.locator(shown).all_inner_texts() == page.locator(shown).all_inner_texts()
    page.go_back()
    settle(page)
    assert state_of(page)["object"] != state["object"]


def test_a_link_to_what_the_run_does_not_have_says_so(visit, path):
    page = visit(path, fragment(category="spoon", azimuth=400))
    settle(page)
    told = page.locator("#notice").inner_text()
    assert "category=spoon" in told
    assert "azimuth=400" in told
    assert state_of(page)["category"] in ("mug", "chair")
    go_to(page, category="mug", elevation=0)
    assert page.locator("#notice").is_hidden()


def test_jumps_lead_to_the_largest_errors_of_the_files(visit, path, outcomes):
    page = visit(path, fragment(category="chair", method="proposed"))
    settle(page)
    errors = errors_of(outcomes, "chair", 0)
    page.locator("[data-method=random] .worst").click()
    settle(page)
    own = errors.loc[state_of(page)["object"]]["random"]
    assert own.loc[int(state_of(page)["azimuth"])] >= own.max() - 0.01
    options = page.locator("#jump option").all_inner_texts()
    assert len(options) == 5
    expected = {
        0: errors["proposed"].loc[[state_of(page)["object"]]],
        1: errors["proposed"],
        2: errors["proposed"] - errors["opposite"],
        4: errors["opposite"] - errors["proposed"],
    }
    for index, values in expected.items():
        page.select_option("#jump", index=index)
        page.click("#go")
        settle(page)
        state = state_of(page)
        assert values.loc[(state["object"], int(state["azimuth"]))] >= values.max() - 0.02
    page.select_option("#jump", index=3)
    by_object = expected[2].groupby("object_id").mean().sort_values()
    for rank in (1, 2):
        page.click("#go")
        settle(page)
        assert state_of(page)["object"] == by_object.index[-rank]
    assert page.locator("#rank").inner_text() == f"2 of {len(by_object)}"


def test_why_one_method_loses_adds_up(visit, path, outcomes):
    page = visit(path, fragment(category="mug", elevation=0, method="proposed"))
    settle(page)
    errors = errors_of(outcomes, "mug", 0)
    gap = errors["proposed"].mean() - errors["opposite"].mean()
    better = errors.groupby("object_id").mean().eval("proposed < opposite")
    text = page.locator("#why").inner_text()
    # The page's errors are in hundredths, and so is what it tells.
    shown, side = re.search(r"is ([\d.]+)° (above|below) that of Opposite", text).groups()
    assert float(shown) == pytest.approx(abs(gap), abs=0.015)
    assert side == ("above" if gap > 0 else "below")
    assert f"All {len(better)} objects" in text
    assert f"better on {better.sum()} objects" in text


@pytest.mark.parametrize("width", WIDTHS)
def test_the_page_fits_without_sideways_scrolling(visit, path, width):
    page = visit(path, fragment(category="mug", elevation=30, views=5), width=width)
    settle(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    outside = page.eval_on_selector_all(
        "select, button, input, #ring, #cost, .view:not([hidden]), .band, #objects",
        """(all, width) => all.filter(one => {
            const box = one.getBoundingClientRect();
            return box.width > 0 && (box.left < 0 || box.right > width);
        }).map(one => one.id || one.className)""",
        width,
    )
    assert not outside


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", WIDTHS[::2])
def test_axe_finds_nothing_inaccessible(visit, path, width, scheme):
    from axe_playwright_python.sync_playwright import Axe

    page = visit(path, fragment(category="mug", views=3), width=width, color_scheme=scheme)
    settle(page)
    page.click("summary")
    found = Axe().run(page)
    assert found.response["passes"]
    assert not found.violations_count, found.generate_report()
    # Every picture says what it shows.
    unnamed = "canvas:not([aria-label]), canvas[aria-label='']"
    assert page.locator(unnamed).locator("visible=true").count() == 0


def test_the_keyboard_alone_reaches_and_changes_everything(visit, path):
    page = visit(path, fragment(category="mug", azimuth=10, method="proposed", views=2))
    settle(page)
    order = []
    for _ in range(60):
        page.keyboard.press("Tab")
        focused = page.evaluate(
            "(a => a.id || a.name || a.className || a.tagName)(document.activeElement)"
        )
        if focused == "BODY":
            break
        order.append(focused)
        if focused == "method":
            page.keyboard.press("ArrowLeft")
        if focused == "views":
            page.keyboard.press("ArrowRight")
        if focused == "azimuth":
            for key in ("ArrowRight", "ArrowRight", "End", "ArrowLeft"):
                page.keyboard.press(key)
    settle(page)
    named = [name for name in order if name in ("category", "elevation", "object", "method")]
    assert named == ["category", "elevation", "object", "method"]
    then = ["views", "next", "jump", "go", "azimuth", "turn", "scope"]
    assert [name for name in order if name in then] == then
    assert order.count("worst") == len(METHODS)
    expected = {"method": "opposite", "views": "3", "azimuth": "358"}
    assert state_of(page).items() >= expected.items()


def test_a_classifiers_own_distribution_is_shown(visit, tree, tmp_path):
    rng, files, kept = np.random.default_rng(0), {}, {}
    evaluations = synthetic.evaluation_files(tree, synthetic.UNITS, 3, ["single"])
    for (*unit, fold, _), path in evaluations.items():
        ids = tuple(pd.read_csv(path, dtype={"object_id": str})["object_id"].drop_duplicates())
        key = (*unit, fold)
        kept[key] = posteriors_of(ids, rng.normal(0, 3, (len(ids), 360, 24)), 1.0)
        files[key] = tmp_path / "{}_{}_{}.npz".format(*key)
        write_posteriors(files[key], kept[key])
    page_file = tmp_path / "explorer.html"
    page_file.write_text(build_explorer(explorer_inputs(tree, posteriors=files)))
    page = visit(page_file, fragment(category="mug", elevation=30, azimuth=44))
    settle(page)
    assert page.locator("#key-own").is_visible()
    for place, name in enumerate(kept["mug", 30, 1].object_ids):
        go_to(page, category="mug", elevation=30, object=name, azimuth=44)
        shown = np.array(page.evaluate("[...ownDistribution(44)]"))
        exact = kept["mug", 30, 1].distributions[place, 45]  # the class nearest to 44°
        assert np.abs(shown - exact).max() <= exact.max() * 0.006


def test_a_run_without_images_is_shown_without_them(visit, tree, tmp_path):
    page_file = tmp_path / "explorer.html"
    page_file.write_text(build_explorer(explorer_inputs(tree)))
    page = visit(page_file, fragment(category="chair", views=3))
    settle(page)
    assert "no image" in page.locator("#view-1 figcaption").inner_text()
    assert page.locator("#key-own").is_hidden()
    assert page.locator("#steps tbody tr").count() == 3
