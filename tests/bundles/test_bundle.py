"""A bundle as a file: what was written comes back, and what was damaged is one line."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import onnx
import pytest
import safetensors
import safetensors.numpy
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from made_bundles import made_bundle, random_codes
from nbv.bundles.bundle import (
    FORMAT,
    PROBABILITY_STEP,
    Bundle,
    BundleError,
    dequantize_logp,
    quantize_logp,
)
from nbv.bundles.recommender import Recommender, bundle_path
from nbv.errors import UserError

# Round trips


def test_everything_but_distributions_comes_back_exactly(bundle, bundle_file):
    found = Bundle.load(bundle_file)
    for name in ("mean", "basis", "references", "scales"):
        wanted = getattr(bundle.ood, name)
        assert np.array_equal(getattr(found.ood, name), wanted), name
    assert found.ood.threshold == bundle.ood.threshold
    assert np.array_equal(found.elevation_deg, bundle.elevation_deg)
    for name in (
        *("category", "estimator", "camera", "diagonal_m", "extent_m", "focal_px", "temperature"),
        *("network", "object_ids", "affinity", "provenance", "n_bins"),
    ):
        assert getattr(found, name) == getattr(bundle, name), name


def test_distributions_come_back_within_the_step(bundle, bundle_file):
    found = Bundle.load(bundle_file).distributions
    assert found.dtype == np.float32
    assert found.sum(axis=-1) == pytest.approx(1.0, abs=1e-5)
    # Half a step, and what the rows are divided by to sum to 1 again.
    ratio = np.log(found) - np.log(bundle.distributions)
    assert np.abs(ratio - np.median(ratio, axis=-1, keepdims=True)).max() < PROBABILITY_STEP + 1e-4
    assert np.abs(ratio).max() < 1.5 * PROBABILITY_STEP


def test_it_does_not_matter_how_arrays_lie_in_memory(bundle, bundle_file, tmp_path):
    """safetensors writes memory as it lies: an array in another order came back scrambled."""

    def other_order(array):
        return np.asfortranarray(array)

    model = replace(
        bundle.ood,
        basis=other_order(bundle.ood.basis),
        references=other_order(bundle.ood.references),
    )
    changed = replace(
        bundle,
        distributions=other_order(bundle.distributions),
        elevation_deg=np.repeat(bundle.elevation_deg, 2)[::2],
        ood=model,
    )
    changed.save(tmp_path / "a.safetensors")
    assert (tmp_path / "a.safetensors").read_bytes() == bundle_file.read_bytes()


def test_a_mirror_plane_comes_back(tmp_path):
    for plane_deg in (None, 0.0, 82.5):
        path = tmp_path / "new.safetensors"
        made_bundle(mirror_plane_deg=plane_deg).save(path)
        assert Bundle.load(path).mirror_plane_deg == plane_deg
    cut = with_about(path, tmp_path / "cut.safetensors", mirror_plane_deg=None)
    assert "mirror_plane_deg" in refused(cut)


def test_provenance_may_be_any_json(tmp_path):
    provenance = {"versions": {"numpy": "2.4"}, "epochs": {10: "ten", 2: "two"}, "ü": [1.5, None]}
    made_bundle(provenance=provenance).save(tmp_path / "a.safetensors")
    found = Bundle.load(tmp_path / "a.safetensors").provenance
    assert found == {**provenance, "epochs": {"10": "ten", "2": "two"}}


def test_a_bundle_serves_from_its_file(recommender, bundle_file):
    codes = np.random.default_rng(3).integers(0, 256, (4, 32, 32)).astype(np.uint8)
    loaded = Recommender.load(bundle_file)
    assert np.array_equal(loaded.distributions(codes), recommender.distributions(codes))


# Steps


@given(arrays(np.float64, (4, 24), elements=st.floats(1e-6, 1.0)))
def test_steps_keep_probabilities_within_half_a_step(values):
    rows = values / values.sum(axis=1, keepdims=True)
    steps = quantize_logp(rows)
    assert steps.dtype == np.uint8
    kept = np.exp(-PROBABILITY_STEP * steps.astype(float))
    in_range = rows > np.exp(-255 * PROBABILITY_STEP)
    assert np.abs(np.log(kept / rows))[in_range].max() <= PROBABILITY_STEP / 2 + 1e-9
    assert dequantize_logp(steps) == pytest.approx(kept / kept.sum(axis=1, keepdims=True), rel=1e-4)


@given(arrays(np.uint8, (3, 16)))
def test_steps_of_steps_are_the_same(steps):
    """Up to the same number of steps in the whole row, which the sum of 1 takes off."""
    again = quantize_logp(dequantize_logp(steps)).astype(int)
    apart = again - steps
    inside = (again < 255) & (steps < 255)
    for row, kept in zip(apart, inside, strict=True):
        if kept.any():
            assert row[kept].max() - row[kept].min() <= 1


def test_impossible_and_certain_have_steps():
    steps = quantize_logp(np.array([0.0, 1e-40, 1e-6, 1.0, 1.0 + 1e-7]))
    assert steps.tolist() == [255, 255, 255, 0, 0]
    assert np.exp(-255 * PROBABILITY_STEP) == pytest.approx(1e-6, rel=0.1)


# Damage


def refused(path, name="damaged-bundle") -> str:
    with pytest.raises(BundleError) as error:
        Bundle.load(path)
    message = str(error.value)
    assert "\n" not in message
    assert path.name in message
    assert error.value.name == name
    assert message.startswith(f"{name}: ")
    return message


def written(path, content: bytes):
    path.write_bytes(content)
    return path


def with_about(bundle_file, path, arrays_=None, **changes):
    """The same arrays, or some others, with other metadata, and with the digest of both.

    What is to be None is left out.
    """
    with safetensors.safe_open(bundle_file, framework="numpy") as stored:
        about = json.loads(stored.metadata()["nbv"])
        held = {name: stored.get_tensor(name) for name in stored.keys()}  # noqa: SIM118
    arrays_ = held | (arrays_ or {})
    about.pop("sha256")
    about |= changes
    about = {name: value for name, value in about.items() if changes.get(name, 0) is not None}
    digest = hashlib.sha256(json.dumps(about, sort_keys=True).encode())
    for name, array in sorted(arrays_.items()):
        digest.update(f"{name} {array.dtype} {array.shape}".encode() + array.tobytes())
    about = {"sha256": digest.hexdigest()} | about
    return written(path, safetensors.numpy.save(arrays_, metadata={"nbv": json.dumps(about)}))


def test_a_missing_file_is_named(tmp_path):
    assert "does not exist" in refused(tmp_path / "none.safetensors", "no-bundle")
    assert "is a folder" in refused(tmp_path, "no-bundle")


@pytest.mark.parametrize("share", [0.0, 0.0001, 0.001, 0.01, 0.1, 0.5, 0.9, 0.9999])
def test_a_file_that_is_cut_short_is_one_line(bundle_file, tmp_path, share):
    content = bundle_file.read_bytes()
    refused(written(tmp_path / "a.safetensors", content[: int(share * len(content))]))


def test_a_longer_file_is_one_line(bundle_file, tmp_path):
    refused(written(tmp_path / "a.safetensors", bundle_file.read_bytes() + b"\0"))


def test_other_files_are_no_bundles(tmp_path):
    refused(written(tmp_path / "a.safetensors", b"not a bundle at all" * 100))
    np.save(tmp_path / "a.npy", np.ones(5))
    refused(tmp_path / "a.npy")
    plain = safetensors.numpy.save({"weights": np.ones(5)})
    assert "not a bundle of nbv" in refused(written(tmp_path / "b.safetensors", plain), "no-bundle")
    other = safetensors.numpy.save({"weights": np.ones(5)}, metadata={"format": "pt"})
    assert "not a bundle of nbv" in refused(written(tmp_path / "c.safetensors", other), "no-bundle")


def test_an_estimator_is_no_bundle(tmp_path):
    import torch

    from made_bundles import SIDE, settings
    from nbv.experiment.estimation.hardware import choose_hardware
    from nbv.experiment.estimation.networks import build_network
    from nbv.experiment.estimation.weights import Estimator, save_estimator

    torch.manual_seed(0)
    estimator = Estimator(build_network(settings(), SIDE), settings(), SIDE, ["a"])
    save_estimator(tmp_path / "e.safetensors", estimator, choose_hardware("cpu", "float32"))
    assert "is an estimator and not a bundle" in refused(tmp_path / "e.safetensors", "no-bundle")


def test_a_newer_format_says_what_to_do(bundle_file, tmp_path):
    path = with_about(bundle_file, tmp_path / "a.safetensors", format=FORMAT + 1)
    message = refused(path, "newer-bundle")
    assert f"format {FORMAT + 1}" in message
    assert "install a newer nbv" in message


@pytest.mark.parametrize("version", [1, 2, 3])
def test_an_older_format_says_what_to_do(bundle_file, tmp_path, version):
    path = with_about(bundle_file, tmp_path / "a.safetensors", format=version)
    message = refused(path, "older-bundle")
    assert f"format {version}" in message
    assert "make it again with snakemake bundles" in message
    assert "nbv calibrate" in message


def test_a_bundle_without_its_digest_is_refused(bundle_file, tmp_path):
    path = with_about(bundle_file, tmp_path / "a.safetensors", sha256="")
    assert "its checksum differs" in refused(path)
    assert Bundle.load(with_about(bundle_file, tmp_path / "b.safetensors")).category == "mug"


@pytest.mark.parametrize(
    "changes",
    [
        {"format": "one"},
        {"camera": None},
        {"camera": {"lens": 3}},
        {"extent_m": [0.1]},
        {"extent_m": [0.2, 0.1]},
        {"extent_m": [float("nan"), 0.1]},
        {"diagonal_m": 0.0},
        {"focal_px": -600.0},
        {"temperature": float("nan")},
        {"familiar_within": 0.0},
        {"mirror_plane_deg": 180.0},
        {"mirror_plane_deg": 91.0},
        {"mirror_plane_deg": float("nan")},
        {"object_ids": []},
        {"object_ids": ["a"]},
        {"estimator": {"n_classes": 120}},
        {"affinity": None},
        {"affinity": {"power": 16}},
        {"affinity": {"power": "much", "pseudo_observations": 90}},
        {"affinity": {"power": 1e300, "pseudo_observations": 90}},
        {"provenance": [1]},
        {"provenance": {"seed": float("nan")}},
        {"provenance": {"turns_made_with": 0}},
        {"format": 4.0},
        {"category": 3},
        {"object_ids": [1, 2, 3, 4, 5, 6]},
        {"diagonal_m": True},
        {"diagonal_m": 1e300},
        {"temperature": 1e-300},
        {"camera": {"image_side": 32, "distance": 1e300}},
        {"camera": {"image_side": 8}},
    ],
    ids=str,
)
def test_metadata_that_makes_no_sense_is_one_line(bundle_file, tmp_path, changes):
    path = with_about(bundle_file, tmp_path / "a.safetensors", **changes)
    assert "is damaged" in refused(path)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("calibration.elevation_deg", np.float32(np.inf)),
        ("calibration.elevation_deg", np.float32(91)),
        ("calibration.weight", np.float32(0)),
        ("calibration.distributions", np.int16(-5)),
        ("familiarity.mean", np.float32(np.inf)),
        ("familiarity.references", np.float16(np.nan)),
        ("familiarity.scales", np.float32(0)),
        ("paper.elevation_deg", np.float32(np.nan)),
        ("paper.rotation_deg", np.int16(360)),
    ],
    ids=str,
)
def test_numbers_out_of_range_are_one_line(bundle_file, tmp_path, name, values):
    with safetensors.safe_open(bundle_file, framework="numpy") as stored:
        array = np.full(stored.get_tensor(name).shape, values)
    path = with_about(bundle_file, tmp_path / "a.safetensors", {name: array})
    assert "is damaged" in refused(path)


def test_a_network_that_gives_no_numbers_gives_no_answer(bundle, rng):
    weights = onnx.load_from_string(bundle.network)
    for constant in weights.graph.initializer:
        values = onnx.numpy_helper.to_array(constant)
        if values.dtype.kind == "f":
            constant.CopyFrom(onnx.numpy_helper.from_array(values * np.nan, constant.name))
    damaged = Recommender(replace(bundle, network=weights.SerializeToString()))
    with pytest.raises(BundleError, match="not finite"):
        damaged.recommend_crops(random_codes(rng, 1))


def test_arrays_that_do_not_fit_are_one_line(bundle, tmp_path):
    for changes in (
        {"distributions": bundle.distributions[:-1]},
        {"distributions": bundle.distributions[:, :-1]},
        {"elevation_deg": bundle.elevation_deg[:-1]},
        {"sweep_weights": bundle.sweep_weights[:-1]},
        {"sweep_weights": np.zeros_like(bundle.sweep_weights)},
        {"object_ids": bundle.object_ids[:-1]},
        {"estimator": {**bundle.estimator, "n_classes": 12}},
        {"paper": replace(bundle.paper, rotation_deg=bundle.paper.rotation_deg + np.int16(9999))},
        {"ood": replace(bundle.ood, mean=bundle.ood.mean[:-1])},
        {"ood": replace(bundle.ood, basis=bundle.ood.basis[:, :-1])},
        {"ood": replace(bundle.ood, references=bundle.ood.references[:0])},
        {"ood": replace(bundle.ood, scales=bundle.ood.scales[:1])},
    ):
        replace(bundle, **changes).save(tmp_path / "a.safetensors")
        assert "is damaged" in refused(tmp_path / "a.safetensors")


@pytest.mark.parametrize("seed", range(3))
def test_one_bit_anywhere_in_an_array_is_noticed(bundle_file, tmp_path, seed):
    content, rng = bytearray(bundle_file.read_bytes()), np.random.default_rng(seed)
    header = int.from_bytes(content[:8], "little") + 8
    for _ in range(20):
        place, bit = int(rng.integers(header, len(content))), 1 << int(rng.integers(0, 8))
        content[place] ^= bit
        assert "is damaged" in refused(written(tmp_path / "a.safetensors", bytes(content)))
        content[place] ^= bit
    Bundle.load(written(tmp_path / "a.safetensors", bytes(content)))


# Names


def test_a_bundle_is_found_by_its_file(bundle_file, tmp_path, monkeypatch):
    assert bundle_path(bundle_file) == bundle_file
    assert bundle_path(str(bundle_file)) == bundle_file
    monkeypatch.chdir(bundle_file.parent)
    assert bundle_path(bundle_file.name).resolve() == bundle_file.resolve()


def test_shipped_bundles_are_found_by_their_names(tmp_path, monkeypatch):
    from nbv.bundles import recommender as module

    (tmp_path / "shipped").mkdir()
    for name in ("mug.safetensors", "chair.safetensors", "README.md"):
        (tmp_path / "shipped" / name).write_bytes(b"")
    monkeypatch.setattr(module.resources, "files", lambda package: tmp_path)
    assert list(module.shipped_bundles()) == ["chair", "mug"]
    assert bundle_path("mug") == tmp_path / "shipped" / "mug.safetensors"
    with pytest.raises(UserError, match="did you mean 'mug'"):
        bundle_path("mugg")
    with pytest.raises(UserError, match="choose from: chair, mug"):
        bundle_path("spaceship")


def test_without_shipped_bundles_a_name_is_one_line(tmp_path, monkeypatch):
    from nbv.bundles import recommender as module

    monkeypatch.setattr(module.resources, "files", lambda package: tmp_path)
    with pytest.raises(UserError, match="this nbv ships no bundle"):
        bundle_path("mug")
