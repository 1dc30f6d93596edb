"""What docs/bundles.md says of several trainings is what the kept errors of each object say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import sem, t
from studies.trainings import crossed_mean

from nbv.data.procedural import generate
from nbv.data.procedural.mug import handle_reach
from nbv.robot.evaluation import FIXED, OPPOSITE, PAPER, RANDOM, RECOMMENDED, SINGLE, SPACED

ROOT = Path(__file__).parents[2]
SEEDS = ["seed_0", "seed_1", "seed_2", "seed_3"]
OBJECTS = ("generated", "shapenet")
OF_8000 = f"{RECOMMENDED}, of 8,000"
"""With every second first view compared, without its neighbours, as in earlier tables."""

LINES = [
    ("in one view", SINGLE, 1),
    ("in two views, recommended", RECOMMENDED, 2),
    ("in two views, opposite", OPPOSITE, 2),
    ("in two views, random", RANDOM, 2),
]


def read(name: str) -> pd.DataFrame:
    table = pd.read_csv(ROOT / "docs/reference/bundles" / name)
    return table.set_index(["objects", "choice", "n_views", "object_id"]).sort_index()[SEEDS]


@pytest.fixture(scope="module")
def errors() -> pd.DataFrame:
    return read("trainings.csv")


@pytest.fixture(scope="module")
def page() -> list[list[str]]:
    """The cells of all rows of the page's tables."""
    lines = (ROOT / "docs/bundles.md").read_text(encoding="utf-8").splitlines()
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if "|" in line]


def shown(errors: pd.DataFrame) -> str:
    """A mean over objects and trainings as the page has it, with its 95 % interval."""
    found = crossed_mean(errors.to_numpy().T).interval()
    one, low, high = (f"{value:.1f}" for value in (found.value, found.low, found.high))
    star = " *" if found.high < 0 or found.low > 0 else ""
    return f"{one} ({low} to {high}){star}".replace("-0.0", "0.0").replace("-", "−")


@pytest.mark.parametrize(
    ("line", "choice", "n_views", "less"),
    [
        ("two views, recommended", RECOMMENDED, 2, None),
        ("… less random", RECOMMENDED, 2, RANDOM),
        ("… less best fixed", RECOMMENDED, 2, FIXED),
        ("… less opposite", RECOMMENDED, 2, OPPOSITE),
        ("… less the paper's method", RECOMMENDED, 2, PAPER),
        ("three views, recommended", RECOMMENDED, 3, None),
        ("… less evenly spaced", RECOMMENDED, 3, SPACED),
        ("one view", SINGLE, 1, None),
    ],
)
def test_means_and_differences_have_intervals_over_objects_and_trainings(
    errors, page, line, choice, n_views, less
):
    (cells,) = (row[1:] for row in page if row[0] == line and len(row) == 3 and "(" in row[1])
    for objects, cell in zip(OBJECTS, cells, strict=True):
        own = errors.loc[objects, choice, n_views]
        wanted = shown(own if less is None else own - errors.loc[objects, less, n_views])
        assert cell.removesuffix(" *") == wanted.removesuffix(" *")
        if less is not None:
            assert cell == wanted


@pytest.mark.parametrize(("line", "choice", "n_views"), LINES)
def test_what_mirror_images_bring_is_the_difference_of_the_kept_errors(page, line, choice, n_views):
    tables = read("any_reach.csv"), read("without_mirror_images.csv")
    (cells,) = (row[1:] for row in page if row[0] == line and len(row) == 3)
    for objects, cell in zip(OBJECTS, cells, strict=True):
        own, other = (table.loc[objects, choice, n_views] for table in tables)
        assert own.index.equals(other.index)
        assert cell == shown(own - other)


@pytest.mark.parametrize(
    ("line", "choice", "n_views"), [*LINES, ("in three views, recommended", RECOMMENDED, 3)]
)
def test_what_handles_that_stand_out_bring_is_the_difference_of_the_kept_errors(
    page, line, choice, n_views
):
    """On the same images: of ShapeNet's mugs, and of generated mugs of any reach."""
    stands_out, before = read("round_mugs.csv"), read("any_reach.csv")
    (cells,) = (row[1:] for row in page if row[0] == line and len(row) == 4)
    own = stands_out.loc["shapenet", choice, n_views]
    assert cells[0] == shown(own - before.loc["shapenet", choice, n_views])
    own = stands_out.loc["generated, any reach", choice, n_views]
    change = own - before.loc["generated", choice, n_views]
    is_far = np.array(
        [
            handle_reach(generate("mug", 0, int(name.removeprefix("mug-")))) >= 0.2
            for name in own.index
        ]
    )
    assert cells[1:] == [shown(change[is_far]), shown(change[~is_far])]


@pytest.mark.parametrize(
    ("line", "choice", "n_views"),
    [
        ("one view", SINGLE, 1),
        ("two views, recommended", RECOMMENDED, 2),
        ("two views, opposite", OPPOSITE, 2),
        ("two views, random", RANDOM, 2),
        ("three views, recommended", RECOMMENDED, 3),
    ],
)
def test_what_square_mugs_bring_is_the_difference_of_the_kept_errors(
    errors, page, line, choice, n_views
):
    before = read("round_mugs.csv")
    (cells,) = (row[1:] for row in page if row[0] == line and len(row) == 4)
    for objects, cell in zip(("shapenet", "generated", "generated, square"), cells, strict=True):
        own = errors.loc[objects, OF_8000 if choice == RECOMMENDED else choice, n_views]
        other = before.loc[objects, choice, n_views]
        assert own.index.equals(other.index)
        assert cell == shown(own - other)


def test_fewer_compared_beliefs_change_what_the_kept_errors_say(errors):
    text = (ROOT / "docs/reference/bundles/README.md").read_text("utf-8")
    names = {"round generated mugs": "generated", "square generated mugs": "generated, square"}
    names |= {"generated mugs of any reach": "generated, any reach"}
    for line, objects in (names | {"mugs of ShapeNet": "shapenet"}).items():
        changes = [
            shown(errors.loc[objects, RECOMMENDED, n] - errors.loc[objects, OF_8000, n])
            for n in (2, 3)
        ]
        assert f"| {line} | {' | '.join(changes)} |" in text
    for recording, place in (("nearly level", "level"), ("from above", "from above")):
        now, then = (
            ", ".join(f"{error:.1f}" for error in errors.loc[f"real, {recording}", one, 2].iloc[0])
            for one in (RECOMMENDED, OF_8000)
        )
        assert f"{now}° instead of {then}° ({place})" in " ".join(text.split())


def test_calibration_mugs_left_out_say_what_fewer_compared_beliefs_cost():
    errors = pd.read_csv(ROOT / "docs/reference/bundles/compared_beliefs.csv")
    text = (ROOT / "docs/reference/bundles/README.md").read_text("utf-8")
    tables = {
        name: rows.set_index(["seed", "object_id"]) for name, rows in errors.groupby("compared")
    }
    before = tables["every second"]
    for name, own in tables.items():
        cells = []
        for column in ("two_views", "two_views_15", "three_views_15"):
            change = own[column] - before[column]
            half = t.ppf(0.975, len(change) - 1) * sem(change)
            values = (change.mean(), change.mean() - half, change.mean() + half)
            one, low, high = (f"{value:.2f}".replace("-0.00", "0.00") for value in values)
            star = " *" if abs(change.mean()) > half else ""
            cell = f"{one} ({low} to {high}){star}".replace("-", "−")
            cells.append(f"{before[column].mean():.2f}" if own is before else cell)
        expected = own["one_view_expected"].mean(), own["two_views_expected"].mean()
        cells.append(f"{expected[0]:.1f} and {expected[1]:.2f}")
        assert f"| {name} | {' | '.join(cells)} |" in text
    now = tables["every fourth, with neighbours"].mean(numeric_only=True)
    assert now["one_view"] == pytest.approx(now["one_view_expected"], abs=0.05)
    assert now["two_views_expected"] / now["two_views"] == pytest.approx(0.85, abs=0.005)


@pytest.fixture(scope="module")
def handles() -> pd.DataFrame:
    table = pd.read_csv(ROOT / "docs/reference/bundles/shapenet_handles.csv")
    return table.set_index("object_id")


def test_mugs_of_shapenet_are_told_apart_by_where_their_handles_are(errors, page, handles):
    away = handles["handle_deg"].abs()
    lines = {
        "within 3° of where the file has it": away <= 3,
        "3 to 14° away from there": away.between(3, 14, inclusive="right"),
    }
    for line, chosen in lines.items():
        (cells,) = (row[1:] for row in page if row[0] == line)
        places = [(SINGLE, 1), (RECOMMENDED, 2), (RECOMMENDED, 3)]
        wanted = [errors.loc[("shapenet", *place)][chosen] for place in places]
        assert cells == [str(chosen.sum()), *(shown(own).removesuffix(" *") for own in wanted)]
    assert sum(lines.values()).sum() == away.notna().sum() == len(away) - 6


def test_three_recommended_views_of_square_mugs_are_worse_than_spaced_ones(errors):
    page = " ".join((ROOT / "docs/bundles.md").read_text("utf-8").split())
    cells = []
    for objects in ("generated, square", "generated, any reach"):
        more = errors.loc[objects, RECOMMENDED, 3] - errors.loc[objects, SPACED, 3]
        assert (more.mean() > 0).all()
        cells.append(shown(more).removesuffix(" *"))
    square, any_reach = (cell.replace(" (", "° (", 1) for cell in cells)
    assert f"square mugs they err by {square} more, in each of the four trainings" in page
    assert f"mugs of any reach by {any_reach}." in page


def test_estimates_follow_the_handle(errors, handles):
    known = handles.dropna()
    assert known["handle_deg"].corr(known["mean_error_deg"]) == pytest.approx(-0.90, abs=0.005)
    two = errors.loc["shapenet", RECOMMENDED, 2].mean(axis=1)
    is_away = handles["handle_deg"].abs() > 3
    as_others = two.where(~is_away, two[handles["handle_deg"].abs() <= 3].mean())
    assert [two.mean(), as_others.mean()] == pytest.approx([4.1, 2.9], abs=0.05)


def test_the_recommended_view_of_the_real_mug_against_its_rivals(errors):
    """In each training (level), and in three of four (from above)."""
    for recording, n_least in (("nearly level", 4), ("from above", 3)):
        of_recording = errors.loc[f"real, {recording}"]
        own, *others = (
            of_recording.loc[choice, 2].iloc[0] for choice in (RECOMMENDED, RANDOM, FIXED, OPPOSITE)
        )
        assert sum(own < pd.concat(others, axis=1).min(axis=1)) == n_least
    wins = [
        (errors.loc[f"real, {name}", RECOMMENDED, 3] < errors.loc[f"real, {name}", SPACED, 3])
        for name in ("nearly level", "from above")
    ]
    assert [int(won.to_numpy().sum()) for won in wins] == [4, 1]


@pytest.mark.parametrize("recording", ["nearly level", "from above"])
def test_the_real_mug_has_a_column_for_each_training(errors, page, recording):
    start = next(i for i, row in enumerate(page) if row[0] == f"{recording}: one view")
    names = [RANDOM, FIXED, OPPOSITE, RECOMMENDED]
    rows = page[start : start + 5]
    assert [row[0].removeprefix("two views, ") for row in rows[1:]] == names
    for choice, n_views, row in zip([SINGLE, *names], [1, 2, 2, 2, 2], rows, strict=True):
        (found,) = errors.loc[f"real, {recording}", choice, n_views].to_numpy()
        assert row[1:] == [f"{error:.1f}" for error in found]


def test_the_shipped_bundle_is_the_first_of_the_trainings(errors, page):
    """The lines of the page's first table of errors."""
    names = {"round generated mugs": "generated", "mugs of ShapeNet": "shapenet"}
    names |= {"square generated mugs": "generated, square"}
    names |= {"generated mugs of any reach": "generated, any reach"}
    names |= {f"real mug, {r}": f"real, {r}" for r in ("nearly level", "from above")}
    columns = [(SINGLE, 1), *((c, 2) for c in (RANDOM, FIXED, OPPOSITE, RECOMMENDED, PAPER))]
    for line, objects in names.items():
        (cells,) = (row[1:] for row in page if row[0] == line and len(row) == 8)
        means = [
            errors.loc[objects, c, n]["seed_0"].mean() for c, n in [*columns, (RECOMMENDED, 3)]
        ]
        assert np.array(cells, float) == pytest.approx(np.array(means), abs=0.0501)


INGREDIENTS = {
    "edges that move": "edge",
    "lost parts and patches": "lost_depth",
    "sensor's noise": "noise",
    "crop off its middle": "shift",
    "occluder": "occlusion",
}


def test_what_ingredients_bring_is_the_difference_of_the_kept_errors(page):
    """On rendered mugs a difference; on the real one the mean, and the least and the greatest."""
    table = pd.read_csv(ROOT / "docs/reference/bundles/ingredients_by_object.csv")
    keys = ["objects", "choice", "n_views", "without", "object_id"]
    errors = table.set_index(keys).sort_index()
    names = set(table["without"])
    rendered, real = (
        {INGREDIENTS.get(name, name): cells for name, *cells in page if len(cells) == n_cells}
        for n_cells in (2, 4)
    )
    assert names <= set(rendered)
    assert names <= set(real)
    views = [(SINGLE, 1), (RECOMMENDED, 2)]
    for name in names:
        for cell, (choice, n_views) in zip(rendered[name], views, strict=True):
            own, with_all = (
                errors.loc["generated", choice, n_views, one] for one in (name, "nothing")
            )
            change = shown(own - with_all)
            signed = change if change.startswith(("−", "0.0")) else f"+{change}"
            assert cell == (f"{own.to_numpy().mean():.1f}" if name == "nothing" else signed)
        recordings = [(place, *view) for place in ("level", "from above") for view in views]
        for cell, (place, choice, n_views) in zip(real[name], recordings, strict=True):
            own = errors.loc["real", choice, n_views, name, place]
            assert cell == f"{own.mean():.1f} ({own.min():.1f} to {own.max():.1f})"


@pytest.mark.parametrize(
    ("line", "choice"),
    [
        ("one view", "one_view"),
        ("two views, recommended", "recommended"),
        ("two views, opposite", "opposite"),
    ],
)
def test_what_calibration_brings_is_what_the_kept_draws_say(line, choice):
    draws = pd.read_csv(ROOT / "docs/reference/bundles/calibrate.csv")
    draws["change"] = draws[f"{choice}_calibrated"] - draws[choice]
    change = draws.pivot_table(index=["mugs", "draw"], columns="seed", values="change")
    cells = [shown(change.loc[n]) for n in (1, 2, 5, 20)]
    text = (ROOT / "docs/turntable.md").read_text("utf-8")
    assert f"| {line} | {' | '.join(cells)} |" in text


def test_expected_errors_agree_with_real_ones_as_the_page_says(page):
    errors = pd.read_csv(ROOT / "docs/reference/bundles/expected_errors.csv")
    means = errors.groupby("elevation").mean(numeric_only=True).round(1)
    rows = {row[0]: row[1:] for row in page if len(row) == 3}
    for line, expected, views, elevation in (
        ("one view", "one_view_expected", "one_view", "not given"),
        *(
            (f"{name}, before the {last} one is taken", f"{views}_expected", views, "not given")
            for name, last, views in (
                ("two views", "second", "two_views"),
                ("three views", "third", "three_views"),
            )
        ),
        ("… without what is added", "two_views_least", "two_views", "not given"),
        ("… once it is taken", "two_views_expected_then", "two_views", "not given"),
        (
            "… once it is taken, three views",
            "three_views_expected_then",
            "three_views",
            "not given",
        ),
        ("… with the elevation given", "two_views_expected", "two_views", "given"),
    ):
        found = means.loc[elevation, [expected, views]]
        assert rows[line] == [f"{value:.1f}" for value in found]
    text = " ".join((ROOT / "docs/bundles.md").read_text(encoding="utf-8").split())
    of_mugs = errors.groupby(["elevation", "training", "object_id"]).mean(numeric_only=True)
    mugs, known, correlations = of_mugs.loc["not given"], [], []
    for views in ("one_view", "two_views", "three_views"):
        for later in ("_then",) if views != "one_view" else ():
            of_taken = mugs[f"{views}_expected{later}"] - mugs[views]
            assert abs(of_taken.mean()) < t.ppf(0.975, len(mugs) - 1) * sem(of_taken)
        missed = mugs[f"{views}_expected"] - mugs[views]
        known.append(t.ppf(0.975, len(missed) - 1) * sem(missed))
        assert abs(missed.mean()) < known[-1]
        correlations.append(np.corrcoef(mugs[f"{views}_expected"], mugs[views])[0, 1])
    assert "The differences are known to ± {:.1f}, {:.1f} and {:.1f}°.".format(*known) in text
    assert f"correlation of {correlations[0]:.2f} for one view, and of less than 0.2" in text
    assert max(correlations[1:]) < 0.2
    by_elevation = errors.groupby(["elevation", "elevation_deg"]).mean(numeric_only=True)
    shown = by_elevation[["two_views_expected", "two_views"]]
    assert (
        "two views have {:.1f}° for {:.1f}° at 30°, and {:.1f}° for {:.1f}° at 60°; where it is "
        "given, {:.1f}° for {:.1f}° and {:.1f}° for {:.1f}°."
    ).format(
        *(
            value
            for elevation in ("not given", "given")
            for at in (30, 60)
            for value in shown.loc[(elevation, at)]
        )
    ) in text
