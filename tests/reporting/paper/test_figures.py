from __future__ import annotations

import shutil
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.image import imread

import synthetic
from nbv.errors import UserError
from nbv.recommendation.evidence import gather_evidence
from nbv.recommendation.lookup import build_lookup, load_lookup, save_lookup
from nbv.reporting.paper import examples
from nbv.reporting.paper.figures import FIGURES, FigureInputs, build_figure, save_figure
from nbv.reporting.paper.figures.depth import depth_limits, shade
from nbv.reporting.paper.figures.inputs import example_view
from nbv.reporting.settings import ReportSettings as ReadingSettings


@pytest.fixture(scope="module")
def inputs(tree, evaluations):
    return FigureInputs(tree, evaluations)


@pytest.mark.parametrize("name", FIGURES)
def test_figures_draw_and_are_written_the_same_twice(inputs, tmp_path, name):
    before = dict(mpl.rcParams)
    first = save_figure(build_figure(name, inputs), tmp_path / "a" / name)
    second = save_figure(build_figure(name, inputs), tmp_path / "b" / name)
    assert dict(mpl.rcParams) == before
    assert [path.suffix for path in first] == [".png", ".pdf"]
    for one, other in zip(first, second, strict=True):
        assert one.read_bytes() == other.read_bytes()
    image = imread(first[0])
    assert image.shape[1] >= 500
    assert np.ptp(image[..., :3]) == 1.0
    for word in (b"Software", b"Creation"):
        assert word not in first[0].read_bytes()
    assert b"CreationDate" not in first[1].read_bytes()


@pytest.mark.parametrize("name", FIGURES)
def test_every_quantity_on_an_axis_has_a_unit(inputs, name):
    for axes in build_figure(name, inputs).axes:
        for label in (axes.get_xlabel(), axes.get_ylabel()):
            if "error" in label.lower() and "pose" not in label:
                assert "degrees" in label
            if "azimuth" in label.lower() or "δ (" in label:
                assert "degrees" in label
            if "A[e" in label:
                assert "nats" in label


@pytest.mark.parametrize("units", [[("mug", 0)], [("mug", 0), ("mug", 30), ("chair", 0)]])
def test_text_stays_inside_the_figure(tree, evaluations, units):
    few = FigureInputs(tree, {unit: evaluations[unit] for unit in units})
    for name in FIGURES:
        figure = build_figure(name, few)
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


def test_figures_work_for_one_category_and_one_fold(tree, evaluations):
    frame = evaluations["chair", 0]
    few = {("chair", 0): frame[(frame["fold"] == 2) & frame["method"].isin(["single", "proposed"])]}
    for name in FIGURES:
        build_figure(name, FigureInputs(tree, few))


def test_methods_beyond_the_papers_are_drawn(tree, evaluations):
    frame = evaluations["mug", 0].astype({"method": str})
    extra = frame[frame["method"] == "proposed"].assign(method="expected_error")
    joined = {("mug", 0): pd.concat([frame, extra], ignore_index=True)}
    settings = ReadingSettings(methods=(*synthetic.METHODS, "expected_error"))
    for name in ("figure7", "figure9", "pea", "azimuth"):
        build_figure(name, FigureInputs(tree, joined, settings))


def test_nearer_is_brighter_and_background_is_white():
    codes = np.array([[0, 50, 120, 200]], dtype=np.uint8)
    assert depth_limits(codes) == (50, 200)
    grey = shade(codes, (50, 200))[0]
    assert grey[0] == 1.0
    assert grey[1] < grey[2] < grey[3] < 0.9
    assert depth_limits(np.zeros((2, 2), np.uint8)) == (1, 255)


@pytest.fixture
def one_fold(tree, evaluations, tmp_path):
    """Inputs of one unit whose lookup table in the example fold a test may replace."""
    root = shutil.copytree(tree, tmp_path / "one")
    path = root / "lookup" / "mug" / "el00" / "fold2" / "entropy.npz"
    return FigureInputs(root, {("mug", 0): evaluations["mug", 0]}), path


@pytest.mark.parametrize("reading", ["given_estimate", "given_truth"])
@pytest.mark.parametrize("spread", ["entropy", "circular_variance"])
def test_the_spread_drawn_is_the_one_that_the_table_stores(one_fold, reading, spread):
    inputs, path = one_fold
    estimates = (np.arange(360) + np.random.default_rng(0).normal(0, 20, (5, 360))) % 360
    made = build_lookup(
        gather_evidence(
            estimates,
            {"reading": reading, "spread": spread},
            bandwidth_deg=9.0,
            pseudo_observations=5.0,
        ),
        "entropy",
    )
    save_lookup(path, made)
    shown = example_view(inputs)
    first = round(shown.estimate_deg) % 360
    figure = build_figure("figure3", inputs)
    lines = {line.get_label().split(",")[0]: line for a in figure.axes for line in a.lines}
    unit = " nats" if spread == "entropy" else ""
    best = int(made.recommended_delta_deg[first])
    worst = int(made.ambiguity[first].argmax())
    for name, delta in (("recommended", best), ("worst", worst)):
        stored = made.ambiguity[first, delta]
        assert lines[name].get_label() == f"{name}, {stored:.2f}{unit}"
        assert lines[name].get_ydata().sum() == pytest.approx(1.0, abs=1e-4)
    unit = "nats" if spread == "entropy" else "0–1"
    for figure_name in ("figure2", "heatmaps"):
        labels = [a.get_ylabel() for a in build_figure(figure_name, inputs).axes]
        shown_units = [label for label in labels if "mbiguity" in label or "A[e, δ]" in label]
        assert shown_units
        assert all(f"({unit})" in label for label in shown_units)


def test_of_equal_ambiguities_the_recommended_one_is_shown(one_fold):
    inputs, path = one_fold
    stored = load_lookup(path)
    save_lookup(path, replace(stored, ambiguity=np.ones_like(stored.ambiguity)))
    shown = example_view(inputs)
    delta = stored.recommended_delta_deg[round(shown.estimate_deg) % 360]
    titles = [axes.get_title() for axes in build_figure("figure2", inputs).axes]
    assert any(title.startswith(f"recommended: δ = {delta}°") for title in titles)


def test_a_category_without_the_reference_elevation_is_shown_at_its_own(tree, evaluations):
    units = {("mug", 30): evaluations["mug", 30], ("chair", 0): evaluations["chair", 0]}
    for name in ("figure5", "figure9", "pea", "azimuth"):
        figure = build_figure(name, FigureInputs(tree, units))
        words = [text.get_text() for a in figure.axes for text in a.get_xticklabels()]
        words += [axes.get_title() for axes in figure.axes]
        words += [axes.get_ylabel() for axes in figure.axes]
        assert {"Mug (30°)", "Chair"} <= set(words), name
        assert "elevation 0°" in figure.get_suptitle()


def test_the_hardest_azimuth_of_the_mug_is_in_the_hidden_range(evaluations):
    assert 30 <= examples.hardest_azimuth_deg(evaluations["mug", 0]) <= 150


def test_mistakes_are_named(inputs, tmp_path, evaluations):
    with pytest.raises(UserError, match="no figure 'figure1'; did you mean 'figure"):
        build_figure("figure1", inputs)
    with pytest.raises(UserError, match="no evaluated category"):
        build_figure("pea", FigureInputs(tmp_path, {}))
    with pytest.raises(UserError, match="does not exist"):
        build_figure("figure5", FigureInputs(tmp_path, evaluations))
