import itertools
from dataclasses import replace
from functools import cache

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.image import imread
from PIL import Image

import synthetic
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.evidence import gather_evidence
from nbv.errors import UserError
from nbv.experiment.report.figures import FIGURES, steps
from nbv.experiment.report.figures.build import build_figure
from nbv.experiment.report.figures.inputs import FigureInputs, example_view
from nbv.experiment.report.figures.views import depth_limits, shade
from nbv.experiment.report.settings import ReportSettings, hardest_azimuth_deg
from nbv.style import save_figure
from nbv.tables.lookup import LookupTable, build_lookup
from reports import figure_inputs

FOLD = 2  # of the examples


@pytest.fixture(scope="module")
def inputs(tree, evaluations):
    return figure_inputs(tree, evaluations)


@pytest.fixture
def drawn_from(inputs, evaluations, tmp_path):
    """Return inputs of one unit whose subject follows the lookup table that a test gives."""

    def made(table):
        path = tmp_path / f"{table.criterion}.npz"
        table.save(path)
        return replace(
            inputs,
            evaluations={("mug", 0): evaluations["mug", 0]},
            lookups={("mug", 0, FOLD): path},
        )

    return made


def stored(inputs):
    return LookupTable.load(inputs.lookups["mug", 0, FOLD])


def errors_of(evaluations, unit, method):
    frame = evaluations[unit]
    return frame[frame["method"] == method]


def images_of(axes):
    return [np.asarray(image.get_array()) for image in axes.images]


def write(figure, folder):
    files = {kind: folder / f"figure.{kind}" for kind in ("png", "pdf", "svg")}
    save_figure(figure, files)
    return files


@pytest.fixture(scope="module")
def drawn(inputs, tmp_path_factory):
    """Return a figure by name, and its files: drawn once, of no more than it says it needs."""

    @cache
    def made(name):
        before = dict(mpl.rcParams)
        given = {field: getattr(inputs, field) for field in FIGURES[name].needs}
        figure = build_figure(name, FigureInputs(inputs.evaluations, **given))
        files = write(figure, tmp_path_factory.mktemp(name))
        assert dict(mpl.rcParams) == before
        return figure, files

    return made


@pytest.mark.parametrize("name", FIGURES)
def test_figures_are_written_without_a_date_and_with_text(drawn, name):
    _, files = drawn(name)
    made_by = b"Software", b"CreationDate", b"dc:date"
    for path in files.values():
        assert not any(word in path.read_bytes() for word in made_by)
    image = imread(files["png"])
    assert image.shape[1] >= 500
    assert "<text" in files["svg"].read_text()
    assert np.ptp(image[..., :3]) == 1.0


# Images, and boxes with lines: all figures are saved by the same function.
@pytest.mark.parametrize("name", ["figure7", "figure9"])
def test_figures_are_written_the_same_twice(inputs, drawn, tmp_path, name):
    _, first = drawn(name)
    second = write(build_figure(name, inputs), tmp_path)
    for kind, path in first.items():
        assert path.read_bytes() == second[kind].read_bytes()


@pytest.mark.parametrize("name", FIGURES)
def test_every_quantity_on_an_axis_has_a_unit(drawn, name):
    for axes in drawn(name)[0].axes:
        for label in (axes.get_xlabel(), axes.get_ylabel()):
            if "error" in label.lower() and "pose" not in label:
                assert "degrees" in label
            if "azimuth" in label.lower() or "δ (" in label:
                assert "degrees" in label
            if "A[e" in label:
                assert "nats" in label


@pytest.mark.parametrize("n_units", [1, 3])
def test_text_stays_inside_the_figure(inputs, drawn, n_units):
    few = replace(inputs, evaluations={("mug", 0): inputs.evaluations["mug", 0]})
    assert len(inputs.evaluations) == 3
    for name in FIGURES:
        figure = build_figure(name, few) if n_units == 1 else drawn(name)[0]
        figure.canvas.draw()
        width, height = figure.canvas.get_width_height()
        texts = [text for axes in figure.axes for text in (axes.title, axes.xaxis.label)]
        texts += [axes.yaxis.label for axes in figure.axes] + figure.texts
        shown = [text for text in texts if text.get_text() and text.get_visible()]
        for artist in [*shown, *figure.legends]:
            box = artist.get_window_extent()
            assert box.x0 >= -1, (name, artist)
            assert box.y0 >= -1, (name, artist)
            assert box.x1 <= width + 1, (name, artist)
            assert box.y1 <= height + 1, (name, artist)


def test_figure2_shows_the_cost_of_three_rotations(inputs, drawn):
    shown, table = example_view(inputs), stored(inputs)
    row = table.cost[round(shown.estimate_deg) % 360]
    deltas = [int(table.recommended_delta_deg[round(shown.estimate_deg) % 360]), 180, row.argmax()]
    axes = drawn("figure2")[0].axes
    bars, curve = axes[4], axes[5]
    assert [bar.get_height() for bar in bars.patches] == pytest.approx(row[deltas])
    assert [text.get_text() for text in bars.texts] == [f"{row[delta]:.3f}" for delta in deltas]
    names = [text.get_text() for text in bars.get_xticklabels()]
    assert names == ["recommended", "opposite", "worst"]
    np.testing.assert_allclose(curve.lines[0].get_ydata(), row)
    assert bars.get_ylim() == curve.get_ylim()
    assert np.ptp(bars.get_ylim()) < 2 * np.ptp(row)
    assert [line.get_xdata()[0] for line in curve.lines[1:]] == deltas
    for panel, name, delta in zip(axes[1:4], names, deltas, strict=True):
        azimuth = (shown.azimuth_deg + delta) % 360
        assert panel.get_title() == f"{name}: δ = {delta}°\nview at {azimuth}°"
        expected = shade(shown.views[azimuth], depth_limits(shown.views))
        np.testing.assert_array_equal(images_of(panel)[0], expected)


def test_figures_5_and_6_show_eight_azimuths_of_every_unit(inputs, drawn):
    for name, units, labels in (
        ("figure5", [("mug", 0), ("chair", 0)], ["Mug", "Chair"]),
        ("figure6", [("mug", 0), ("mug", 30)], ["0°", "30°"]),
    ):
        axes = np.array(drawn(name)[0].axes).reshape(len(units), 8)
        assert [panel.get_ylabel() for panel in axes[:, 0]] == labels
        assert [panel.get_title() for panel in axes[0]] == [f"{45 * k}°" for k in range(8)]
        for row, unit in zip(axes, units, strict=True):
            views = np.load(inputs.depth[unit])[0, ::45]
            for panel, codes in zip(row, views, strict=True):
                expected = shade(codes, depth_limits(views))
                np.testing.assert_array_equal(images_of(panel)[0], expected)


def test_figure7_shows_the_next_view_of_each_method(inputs, drawn):
    shown = example_view(inputs)
    first, *others = drawn("figure7")[0].axes
    assert f"error {shown.outcomes['single']['error_deg']:.1f}°" in first.get_xlabel()
    assert [panel.get_title() for panel in others] == ["Random", "Opposite", "Proposed"]
    for panel, method in zip(others, synthetic.METHODS[1:], strict=True):
        row = shown.outcomes[method]
        azimuth = int(shown.azimuth_deg + row["delta_deg"]) % 360
        assert panel.get_xlabel() == (
            f"δ = {row['delta_deg']:.0f}°, view at {azimuth}°\n"
            f"pose {row['pose_estimate_deg']:.1f}°, error {row['error_deg']:.1f}°"
        )
        expected = shade(shown.views[azimuth], depth_limits(shown.views))
        np.testing.assert_array_equal(images_of(panel)[0], expected)


def test_figure8_puts_every_view_where_the_camera_is(drawn):
    ring, *views = drawn("figure8")[0].axes
    texts = [text.get_text().split("\n")[0] for text in ring.texts]
    assert texts == [f"Group {group}" for group in (1, 2, 3, 4)]
    assert len(views) == 12
    for panel in views:
        box = panel.get_position()
        across, up = (box.x0 + box.x1) / 2 - 0.5, (box.y0 + box.y1) / 2 / (6.4 / 6.8) - 0.5
        angle = np.degrees(np.arctan2(up, across))
        assert circular_distance_deg(angle, int(panel.get_title()[:-1])) < 2


def test_figure9_boxes_are_the_quartiles_of_the_errors(drawn, evaluations):
    figure = drawn("figure9")[0]
    units = [("mug", 0), ("chair", 0)]
    texts = [text.get_text() for text in figure.axes[1].get_xticklabels(minor=True)]
    assert texts == ["Single", "Random", "Opposite", "Proposed"] * len(units)
    for axes, ends in zip(figure.axes, ((0, 100), (5, 95)), strict=True):
        assert [text.get_text() for text in axes.get_xticklabels()] == ["Mug", "Chair"]
        assert len(axes.patches) == len(units) * len(synthetic.METHODS)
        # Of each box: two whiskers, two caps, the median and the mean.
        boxes = zip(axes.patches, np.reshape(axes.lines, (-1, 6)), strict=True)
        for method, unit in itertools.product(synthetic.METHODS, units):
            box, (lower, upper, _, _, median, mean) = next(boxes)
            errors = errors_of(evaluations, unit, method)["error_deg"].to_numpy()
            corners = box.get_path().vertices[:, 1]
            expected = np.percentile(errors, (25, 75))
            assert [corners.min(), corners.max()] == pytest.approx(expected)
            assert median.get_ydata()[0] == pytest.approx(np.median(errors))
            assert mean.get_ydata()[0] == pytest.approx(errors.mean())
            low, high = np.percentile(errors, ends)
            assert lower.get_ydata()[-1] == errors[errors >= low].min()
            assert upper.get_ydata()[-1] == errors[errors <= high].max()


@pytest.mark.parametrize("name", ["pea", "azimuth"])
def test_curves_are_of_every_method_and_category(drawn, evaluations, name):
    figure = drawn(name)[0]
    assert [axes.get_title() for axes in figure.axes] == ["Mug", "Chair"]
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == ["Single", "Random", "Opposite", "Proposed"]
    for axes, unit in zip(figure.axes, [("mug", 0), ("chair", 0)], strict=True):
        for line, method in zip(axes.lines, synthetic.METHODS, strict=False):
            errors = errors_of(evaluations, unit, method)["error_deg"].to_numpy()
            x, y = line.get_data()
            if name == "azimuth":
                assert np.mean(y) == pytest.approx(errors.mean())
                continue
            for place in (0, 100, 250, 400):
                assert y[place] == np.mean(errors < x[place])


def test_heatmaps_show_the_stored_table(inputs, drawn):
    table = stored(inputs)
    left, right, *bars = drawn("heatmaps")[0].axes
    np.testing.assert_allclose(images_of(left)[0], table.viewpoint_likelihood.T)
    np.testing.assert_allclose(images_of(right)[0], table.cost.T)
    np.testing.assert_array_equal(right.lines[0].get_ydata(), table.recommended_delta_deg)
    assert right.get_title() == "Entropy A[e, δ], dots: recommended"
    assert bars[1].get_ylabel() == "Ambiguity (nats); lower is better"


def test_figures_work_for_one_category_and_one_fold(inputs, evaluations):
    frame = evaluations["chair", 0]
    few = {("chair", 0): frame[(frame["fold"] == 2) & frame["method"].isin(["single", "proposed"])]}
    for name in FIGURES:
        build_figure(name, replace(inputs, evaluations=few))


def test_an_extension_is_drawn_with_the_papers_methods(inputs, evaluations):
    frame = evaluations["mug", 0].astype({"method": str})
    extra = frame[frame["method"] == "proposed"].assign(method="error_posterior")
    joined = {("mug", 0): pd.concat([frame, extra], ignore_index=True)}
    settings = ReportSettings(methods=(*synthetic.METHODS, "error_posterior"))
    more = replace(inputs, evaluations=joined, settings=settings)
    for name in ("pea", "azimuth"):
        (legend,) = build_figure(name, more).legends
        assert "Error posterior" in [text.get_text() for text in legend.get_texts()]
    boxes = build_figure("figure9", more).axes[1].get_xticklabels(minor=True)
    assert boxes[-1].get_text() == "Error posterior"
    assert build_figure("figure7", more).axes[-1].get_title() == "Error posterior"


def test_nearer_is_brighter_and_background_is_white():
    codes = np.array([[0, 50, 120, 200]], dtype=np.uint8)
    assert depth_limits(codes) == (50, 200)
    grey = shade(codes, (50, 200))[0]
    assert grey[0] == 1.0
    assert grey[1] < grey[2] < grey[3] < 0.9
    assert depth_limits(np.zeros((2, 2), np.uint8)) == (1, 255)


@pytest.mark.parametrize("pose_likelihood", ["given_estimate", "through_estimate"])
@pytest.mark.parametrize("spread", ["entropy", "circular_variance"])
def test_the_spread_drawn_is_the_one_that_the_table_stores(drawn_from, pose_likelihood, spread):
    estimates = (np.arange(360) + np.random.default_rng(0).normal(0, 20, (5, 360))) % 360
    settings = {"pose_likelihood": pose_likelihood, "spread": spread}
    made = build_lookup(
        gather_evidence(estimates, settings, bandwidth_deg=9.0, pseudo_observations=5.0),
        "pose_ambiguity",
    )
    inputs = drawn_from(made)
    first = round(example_view(inputs).estimate_deg) % 360
    figure = build_figure("figure3", inputs)
    lines = {line.get_label().split(",")[0]: line for a in figure.axes for line in a.lines}
    unit = " nats" if spread == "entropy" else ""
    best = int(made.recommended_delta_deg[first])
    worst = int(made.cost[first].argmax())
    for name, delta in (("recommended", best), ("worst", worst)):
        assert lines[name].get_label() == f"{name}, {made.cost[first, delta]:.2f}{unit}"
        assert lines[name].get_ydata().sum() == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize(
    ("criterion", "spread", "name", "cost", "title"),
    [
        ("pose_ambiguity", "entropy", "Ambiguity", "Ambiguity (nats)", "Entropy A"),
        ("pose_ambiguity", "circular_variance", "Ambiguity", "Ambiguity (0–1)", "Circular v"),
        ("expected_error", "entropy", "Expected error", "Cost (degrees)", "Expected error: cost A"),
        ("information_gain", "circular_variance", "Information gain", "Cost (nats)", "Information"),
        ("fixed", "entropy", "Fixed", "Cost (degrees)", "Fixed: cost A"),
    ],
)
def test_figures_name_the_cost_of_the_criterion_that_the_subject_follows(
    inputs, drawn_from, criterion, spread, name, cost, title
):
    """As with methods.proposed.policy=expected_error: no table of another criterion is needed."""
    table = replace(stored(inputs), criterion=criterion, spread=spread)
    few = drawn_from(table)
    selection, maps = (build_figure(figure, few) for figure in ("figure2", "heatmaps"))
    assert selection.get_suptitle().startswith(f"{name} selects the next view")
    quantity, unit = cost[:-1].split(" (")
    labels = [axes.get_ylabel() for axes in selection.axes]
    assert f"{quantity} A[e, δ] ({unit})" in labels
    assert f"A[e, δ] ({unit})" in labels
    assert maps.axes[1].get_title().startswith(title)
    assert maps.axes[-1].get_ylabel() == f"{cost}; lower is better"
    # The spread of the pose, whatever selects the view, is in the unit of the spread.
    names = [text.get_text() for axes in build_figure("figure3", few).axes for text in axes.texts]
    assert any(text.endswith(" nats") for text in names) == (spread == "entropy")


def test_of_equal_costs_the_recommended_rotation_is_shown(inputs, drawn_from):
    table = stored(inputs)
    cost = np.ones_like(table.cost)
    cost[:, [100, 260]] = 0.5
    few = drawn_from(replace(table, cost=cost, recommended_delta_deg=np.full(360, 100)))
    titles = [axes.get_title() for axes in build_figure("figure2", few).axes]
    assert any(title.startswith("recommended: δ = 100°") for title in titles)


def test_a_category_without_the_reference_elevation_is_shown_at_its_own(inputs, evaluations):
    units = {("mug", 30): evaluations["mug", 30], ("chair", 0): evaluations["chair", 0]}
    for name in ("figure5", "figure9", "pea", "azimuth"):
        figure = build_figure(name, replace(inputs, evaluations=units))
        words = [text.get_text() for a in figure.axes for text in a.get_xticklabels()]
        words += [axes.get_title() for axes in figure.axes]
        words += [axes.get_ylabel() for axes in figure.axes]
        assert {"Mug (30°)", "Chair"} <= set(words), name
        assert "elevation 0°" in figure.get_suptitle()


def test_the_hardest_azimuth_of_the_mug_is_in_the_hidden_range(evaluations):
    assert 30 <= hardest_azimuth_deg(evaluations["mug", 0]) <= 150


def test_mistakes_are_named(inputs, tmp_path, evaluations):
    with pytest.raises(UserError, match="no figure 'figure1'; did you mean 'figure"):
        build_figure("figure1", inputs)
    with pytest.raises(UserError, match="no evaluated category"):
        build_figure("pea", FigureInputs({}))
    with pytest.raises(UserError, match="no depth images for mug 0"):
        build_figure("figure5", FigureInputs(evaluations))
    absent = dict.fromkeys(evaluations, tmp_path / "absent.npy")
    with pytest.raises(UserError, match=r"absent\.npy does not exist"):
        build_figure("figure5", FigureInputs(evaluations, depth=absent, objects=absent))
    with pytest.raises(UserError, match="no lookup table of proposed for mug 0 2"):
        build_figure("heatmaps", replace(inputs, lookups={}))


def test_steps_show_the_row_of_the_table_and_both_distributions(inputs, drawn):
    shown, table = example_view(inputs), stored(inputs)
    first = round(shown.estimate_deg) % 360
    delta = int(table.recommended_delta_deg[first])
    one, _, cost, ring, two, _ = drawn("steps")[0].axes
    np.testing.assert_allclose(one.lines[0].get_ydata(), table.viewpoint_likelihood[first])
    np.testing.assert_allclose(cost.lines[0].get_ydata(), table.cost[first])
    assert f"least at {delta}°" in [text.get_text() for text in cost.texts]
    assert [text.get_text() for text in ring.texts] == ["1", "2"]
    second = round(float(shown.outcomes["proposed"]["next_estimate_deg"])) % 360
    azimuths = np.arange(360)
    both = (
        table.viewpoint_likelihood[first]
        * table.estimate_likelihood[(azimuths + delta) % 360, second]
    )
    np.testing.assert_allclose(two.lines[0].get_ydata(), both / both.sum(), rtol=1e-4)


@pytest.fixture(scope="module")
def frames(inputs):
    return list(steps.animation_frames(inputs))


@pytest.mark.slow
def test_the_animation_moves_from_the_first_view_to_the_recommended_one(inputs, frames):
    shown, table = example_view(inputs), stored(inputs)
    delta = int(table.recommended_delta_deg[round(shown.estimate_deg) % 360])
    views = [int(figure.axes[0].get_xlabel().split()[-1][:-1]) for figure, _ in frames]
    assert views[0] == shown.azimuth_deg
    assert views[-1] == (shown.azimuth_deg + delta) % 360
    moved = np.abs((np.diff(views) + 180) % 360 - 180)
    assert moved.max() <= 180 / 20
    assert moved.sum() == circular_distance_deg(delta, 0)
    likely = [figure.axes[1].lines[0].get_ydata().max() for figure, _ in frames]
    assert likely[-1] > likely[0]
    assert all(duration > 0 for _, duration in frames)


@pytest.mark.slow
def test_an_animation_is_written_the_same_twice(inputs, frames, tmp_path, monkeypatch):
    few = frames[::25]
    monkeypatch.setattr(steps, "animation_frames", lambda _: iter(few))
    paths = [tmp_path / f"{run}.gif" for run in "ab"]
    for path in paths:
        steps.save_animation(inputs, path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with Image.open(paths[0]) as image:
        assert image.n_frames == len(few)
        assert image.info["loop"] == 0
