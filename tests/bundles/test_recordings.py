"""Manifests of recordings, and what a network makes of their frames."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from made_bundles import FOCAL_PX, frame
from nbv.bundles.recordings import read_manifest, run_network
from nbv.errors import FrameError, UserError
from nbv.frames.depth_files import read_depth
from nbv.frames.intrinsics import Intrinsics

AZIMUTHS = (0.0, 10.0, 20.0, 350.0)


@pytest.fixture
def folder(tmp_path) -> Path:
    """Four frames, as .npy, and their masks, as .png."""
    for place in range(4):
        np.save(tmp_path / f"f{place}.npy", frame(place))
        mask = 255 * (frame(place) > 0).astype(np.uint8)
        Image.fromarray(mask).save(tmp_path / f"m{place}.png")
    return tmp_path


def table(**columns) -> pd.DataFrame:
    needed = {
        "object_id": ["cup"] * 4,
        "sequence": ["1"] * 4,
        "file": [f"f{place}.npy" for place in range(4)],
        "azimuth_deg": list(AZIMUTHS),
    }
    return pd.DataFrame(needed | columns)


def manifest(folder: Path, frame_: pd.DataFrame) -> Path:
    frame_.to_csv(folder / "manifest.csv", index=False)
    return folder / "manifest.csv"


def refused(path: Path) -> str:
    with pytest.raises(UserError, match=path.name) as error:
        read_manifest(path)
    assert "\n" not in str(error.value)
    return str(error.value)


def told(lines: list[str]):
    return lambda path, error: lines.append(f"{path} is left out: {error}")


# Manifests


def test_rows_are_the_frames_of_a_recording(folder):
    (found,) = read_manifest(manifest(folder, table()))
    assert (found.object_id, found.sequence) == ("cup", "1")
    assert found.azimuth_deg.tolist() == list(AZIMUTHS)
    assert [Path(name) for name in found.frames["path"]] == [
        folder / f"f{place}.npy" for place in range(4)
    ]
    assert found.intrinsics == (None,) * 4
    assert np.isnan(found.elevation_deg)


def test_each_object_and_sequence_is_a_recording(folder):
    rows = table(object_id=["b", "a", "b", "a"], sequence=["1", "2", "1", "1"])
    found = read_manifest(manifest(folder, rows))
    assert [(one.object_id, one.sequence) for one in found] == [("a", "1"), ("a", "2"), ("b", "1")]
    assert [one.azimuth_deg.tolist() for one in found] == [[350.0], [10.0], [0.0, 20.0]]
    assert [Path(name).name for name in found[2].frames["path"]] == ["f0.npy", "f2.npy"]


def test_names_stay_as_they_are_written(folder):
    """An object called NA, or a number with zeros before it, is none that is absent."""
    rows = table(object_id=["NA", "007", "null", ""], sequence=["1e3", "nan", "02", ""])
    found = read_manifest(manifest(folder, rows))
    assert {(one.object_id, one.sequence) for one in found} == {
        *(("NA", "1e3"), ("007", "nan"), ("null", "02"), ("", ""))
    }


def test_the_elevation_is_the_mean_of_what_is_known(folder):
    (known,) = read_manifest(manifest(folder, table(elevation_deg=[20, 22, "", 24])))
    assert known.elevation_deg == 22.0
    (none,) = read_manifest(manifest(folder, table(elevation_deg=["", "", " ", "nan"])))
    assert np.isnan(none.elevation_deg)


def test_frames_may_have_intrinsics_of_their_own(folder):
    rows = table(
        fx=[500, "", 600, 500], fy=[510, "", 600, 500], cx=[320, "", "", 320], cy=[240, "", "", 240]
    )
    (found,) = read_manifest(manifest(folder, rows))
    assert found.intrinsics == (
        Intrinsics(500, 510, 320, 240),
        None,
        Intrinsics(600, 600),
        Intrinsics(500, 500, 320, 240),
    )
    (alone,) = read_manifest(manifest(folder, table(fx=[500, 600, "", 700])))
    assert alone.intrinsics == (
        Intrinsics(500, 500),
        Intrinsics(600, 600),
        None,
        Intrinsics(700, 700),
    )


def test_files_count_from_the_folder_of_the_manifest(folder, monkeypatch):
    (folder / "deep").mkdir()
    rows = table(file=[f"../f{place}.npy" for place in range(4)], mask=["../m0.png", "", "", ""])
    path = manifest(folder / "deep", rows)
    monkeypatch.chdir(folder.parent)
    (found,) = read_manifest(path)
    assert all(Path(name).is_file() for name in found.frames["path"])
    assert Path(found.frames["mask"][0]).is_file()
    absolute = table(file=[str(folder / f"f{place}.npy") for place in range(4)])
    (same,) = read_manifest(manifest(folder / "deep", absolute))
    assert [Path(a).resolve() for a in same.frames["path"]] == [
        Path(b).resolve() for b in found.frames["path"]
    ]


def test_a_file_occurs_once_in_a_sequence(folder):
    message = refused(manifest(folder, table(file=["f0.npy", "f1.npy", "f2.npy", "f1.npy"])))
    assert "row 5: file 'f1.npy' is in this sequence already" in message
    rows = table(file=["f0.npy", "f1.npy", "f0.npy", "f1.npy"], sequence=[1, 1, 2, 2])
    assert len(read_manifest(manifest(folder, rows))) == 2


def test_commas_stand_between_columns(folder):
    table().to_csv(folder / "manifest.csv", index=False, sep=";")
    assert refused(folder / "manifest.csv").endswith("; separate columns by commas")


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("no.npy", "does not exist"),
        ("sub/f0.npy", "does not exist"),
        ("", "is empty"),
        (".", "is a folder"),
    ],
)
def test_a_missing_file_is_named_with_its_row(folder, name, fault):
    message = refused(manifest(folder, table(file=["f0.npy", name, "f2.npy", "f3.npy"])))
    assert f"row 3: file {name!r} {fault}" in message


def test_a_manifest_without_rows_or_that_does_not_exist_is_one_line(tmp_path):
    assert "no rows" in refused(manifest(tmp_path, table().iloc[:0]))
    assert "does not exist" in refused(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"mask": ["", "m9.png", "", ""]}, "row 3: mask 'm9.png' does not exist"),
        (
            {"azimuth_deg": [0, 10, "north", 30]},
            "azimuth_deg 'north' is not a finite number",
        ),
        ({"fx": [500, -500, "", 500]}, "row 3: intrinsics: fx=-500 must be above 0"),
        ({"fx": [500, "", "", ""], "cx": ["", "", "", 320]}, "row 5: cx without fx"),
        ({"fx": [500] * 4, "cx": [320, 320, 320, ""], "cy": [240, "", 240, ""]}, "cx without cy"),
        (
            {"elevation_deg": [10, "", 100, ""]},
            "row 4: elevation_deg '100' is not between -90",
        ),
    ],
)
def test_a_cell_that_cannot_be_is_named_with_its_row(folder, columns, message):
    assert message in refused(manifest(folder, table(**columns)))


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("cup,1,f0.npy,0\ncup,1,f1.npy,10,5", "row 3: 5 values and the head has 4"),
        ("cup,1,f0.npy,0,\ncup,1,f1.npy,10,", "row 2: 5 values and the head has 4"),
        ("cup,1,f0.npy,0\ncup,1,f1.npy", "row 3: 3 values and the head has 4"),
        ('cup,1,f0.npy,"0,5"', "row 2: azimuth_deg '0,5' is not a finite number; write 0.5"),
        ("cup,1,f0.npy,1e300", "row 2: azimuth_deg '1e300' is not between -1000000"),
    ],
)
def test_a_row_has_a_value_for_each_column(folder, rows, message):
    path = folder / "manifest.csv"
    path.write_text(f"object_id,sequence,file,azimuth_deg\n{rows}\n")
    assert message in refused(path)


def test_a_column_occurs_once(folder):
    path = folder / "manifest.csv"
    path.write_text("object_id,sequence,file,azimuth_deg,file\ncup,1,f0.npy,0,f1.npy\n")
    assert "two columns 'file'" in refused(path)


# What the network makes of them


def seen(recommender, path, intrinsics=None, depth_scale=None):
    lines: list[str] = []
    (recording,) = read_manifest(path)
    return run_network(recommender, recording, intrinsics, depth_scale, told(lines)), lines


def crops(recommender, places, **options):
    return np.stack([recommender.crop(frame(place), **options).codes for place in places])


def test_a_turn_has_the_outputs_of_every_frame(recommender, folder):
    sweep, lines = seen(recommender, manifest(folder, table(elevation_deg=[20, 20, 20, 20])))
    seen_crops = crops(recommender, range(4))
    assert np.array_equal(sweep.logits, recommender.network(seen_crops))
    assert np.array_equal(sweep.codes, seen_crops)
    assert sweep.azimuth_deg.tolist() == list(AZIMUTHS)
    assert (sweep.object_id, sweep.sequence, sweep.elevation_deg) == ("cup", "1", 20.0)
    assert lines == []


def test_a_refused_frame_is_told_and_left_out(recommender, folder):
    np.save(folder / "f1.npy", np.zeros_like(frame(1)))
    np.save(folder / "f3.npy", (frame(3) * 100).astype(np.uint8))
    sweep, lines = seen(recommender, manifest(folder, table()))
    assert sweep.azimuth_deg.tolist() == [0.0, 20.0]
    logits = recommender.network(crops(recommender, (0, 2)))
    assert np.array_equal(sweep.logits, logits)
    assert len(lines) == 2
    assert "f1.npy is left out: empty-mask" in lines[0]
    assert "f3.npy is left out: few-levels" in lines[1]


def test_doubts_and_files_of_the_used_frames_are_kept(recommender, folder):
    np.save(folder / "f1.npy", np.zeros_like(frame(1)))
    (folder / "camera.yaml").write_text(
        f"fx: {FOCAL_PX}\nfy: {FOCAL_PX}\ncx: 60\ncy: 45\nk1: 0.1\n"
    )
    sweep, _ = seen(recommender, manifest(folder, table()), str(folder / "camera.yaml"))
    assert [Path(name).name for name in sweep.files] == ["f0.npy", "f2.npy", "f3.npy"]
    (warning,) = sweep.warnings
    assert "object 'cup', sequence '1': 3 of 3 frames" in warning
    assert "distortion (k1) is not corrected" in warning


def test_a_recording_without_a_usable_frame_is_one_line(recommender, folder):
    for place in range(4):
        np.save(folder / f"f{place}.npy", np.zeros((5, 5), np.float32))
    wanted = (
        "^empty-mask: object 'cup', sequence '1': every frame is rejected; the first, .*f0.npy: "
    )
    with pytest.raises(FrameError, match=wanted):
        seen(recommender, manifest(folder, table()))


def test_a_mistyped_optional_column_is_refused_and_others_may_stand(folder):
    for name in ("elevation", "elevaton_deg", "Elevation_dg"):
        message = refused(manifest(folder, table(**{name: ["1"] * 4})))
        assert (
            f"a column {name.lower()!r}; call it 'elevation_deg' if it is that, or remove it"
            in message
        )
    for name in ("note", "task", "elevation_rad", "elevation_mm", "declination_deg", "mask_id"):
        assert read_manifest(manifest(folder, table(**{name: ["1"] * 4})))


def test_a_damaged_frame_is_no_refused_one(recommender, folder):
    (folder / "f2.npy").write_bytes(b"damaged")
    with pytest.raises(UserError, match=r"f2\.npy cannot be read"):
        seen(recommender, manifest(folder, table()))


def test_masks_are_used_where_there_are_any(recommender, folder):
    wall = np.where(frame(1) > 0, frame(1), 0.56).astype(np.float32)
    np.save(folder / "f1.npy", wall)
    rows = table(mask=["", "m1.png", "m2.png", ""])
    sweep, lines = seen(recommender, manifest(folder, rows))
    assert lines == []
    logits = recommender.network(crops(recommender, range(4)))
    assert np.array_equal(sweep.logits, logits)
    _, lines = seen(recommender, manifest(folder, table()))
    assert len(lines) == 1


def test_a_value_names_the_object_in_masks_of_labels(recommender, folder):
    for place in range(4):
        labels = 2 * (frame(place) > 0).astype(np.uint8)
        labels[:8, :8] = 1
        Image.fromarray(labels).save(folder / f"m{place}.png")
    path = manifest(folder, table(mask=[f"m{place}.png" for place in range(4)]))
    (recording,) = read_manifest(path)
    sweep = run_network(recommender, recording, None, None, told([]), mask_value=2)
    assert np.array_equal(sweep.codes, crops(recommender, range(4)))
    with pytest.raises(UserError, match=r"m0\.png: which value is the object\?"):
        seen(recommender, path)


def test_intrinsics_of_a_frame_come_before_those_of_all(recommender, folder):
    others = 1.1 * FOCAL_PX
    rows = table(fx=[FOCAL_PX, "", FOCAL_PX, ""])
    sweep, _ = seen(recommender, manifest(folder, rows), str(others))
    own = crops(recommender, range(4))
    of_all = crops(recommender, range(4), intrinsics=(others,))
    logits = recommender.network(np.stack([own[0], of_all[1], own[2], of_all[3]]))
    assert np.array_equal(sweep.logits, logits)


def test_a_scene_of_bop_gives_every_frame_its_own_camera_and_scale(recommender, folder):
    scene = {}
    for place in range(4):
        unit, focal = (1e-4, 2e-4)[place % 2], (1.0, 1.1)[place // 2] * FOCAL_PX
        np.save(folder / f"00{place}.npy", np.rint(frame(place) / unit).astype(np.uint16))
        scene[str(place)] = {
            "cam_K": [focal, 0, 60, 0, focal, 45, 0, 0, 1],
            "depth_scale": unit * 1000,
        }
    (folder / "scene_camera.json").write_text(json.dumps(scene))
    rows = table(file=[f"00{place}.npy" for place in range(4)])
    sweep, lines = seen(recommender, manifest(folder, rows), str(folder / "scene_camera.json"))
    wanted = [
        recommender.crop(
            read_depth(folder / f"00{place}.npy", (1e-4, 2e-4)[place % 2]),
            intrinsics=[(1.0, 1.1)[place // 2] * FOCAL_PX] * 2 + [60, 45],
        ).codes
        for place in range(4)
    ]
    assert lines == []
    assert np.array_equal(sweep.codes, wanted)


def test_the_scale_of_whole_numbers_is_that_of_the_recording(recommender, folder):
    wanted, _ = seen(recommender, manifest(folder, table()))
    for place in range(4):
        np.save(folder / f"f{place}.npy", np.rint(frame(place) * 1e5).astype(np.uint32))
    sweep, _ = seen(recommender, manifest(folder, table()), depth_scale=1e-5)
    assert sweep.logits == pytest.approx(wanted.logits, abs=0.2)
    with pytest.raises(UserError, match="every frame"):
        seen(recommender, manifest(folder, table()))
