"""What users gave and how it is answered: files that lie beside the project."""

from pathlib import Path

import pytest

from nbv.cli import main

CASES = Path(__file__).parents[3] / "shared" / "cases" / "2"
NEXT = "next bop_example/table.npz --sphere 20 --estimate"

ANSWERED = {
    f"{NEXT} views_pose_convention/ok.json": "decision   enough",
    f"{NEXT} score_scale/neg.json": "expected error 66.5°",
    f"{NEXT} one_view_pose_mm/one.json --camera-pose one_view_pose_mm/pose_mm.txt": "give metres",
    "calibrate bop_failnan/results.csv": "4 of 160 estimates are failures",
    "calibrate bop_gtempty/results.csv": "80 of 160 estimates are farther than 50 mm",
    "calibrate bop_nest/results.csv": "160 pairs of 4 instances",
    "calibrate bop_spaces/results.csv": "160 pairs of 4 instances",
    "calibrate mesh_axes_differ/results.csv": "a constant rotation",
    "calibrate csv_capital_head/capital_head_p.csv": "3 objects",
    "calibrate csv_comment_first/comment_first_p.csv": "3 objects",
    "calibrate csv_space_after_comma/space_after_comma_p.csv": "3 objects",
    "calibrate csv_space_after_id/space_after_id_p.csv": "3 objects",
    **{
        f"calibrate bop_example/results.csv --models-info models_info_{name}/models_info.json": told
        for name, told in {
            "cont_dict": "error 1.9°",
            "key_000001": "no entry for object 1 (it has 000001)",
            "key_obj_000001": "no entry for object 1 (it has obj_000001)",
        }.items()
    },
}
REFUSED = {
    f"{NEXT} views_pose_convention/gl.json": "camera poses are OpenGL's",
    f"{NEXT} views_pose_convention/inv.json": "camera poses are inverted",
    f"{NEXT} views_pose_convention/body.json": "camera poses are of other axes",
    "calibrate bop_gtnan/results.csv": "000001/scene_gt.json, image 3, instance 0: cam_R_m2c",
    "calibrate bop_cam1/results.csv": "scene_gt_cam1.json, or that of",
    "calibrate bop_example/results.csv --models-info models_info_duplicate_key/models_info.json": (
        "the key 'symmetries_discrete' is there twice"
    ),
}


@pytest.mark.skipif(not CASES.is_dir(), reason="../shared/cases/2 is absent")
@pytest.mark.parametrize(("command", "told"), (ANSWERED | REFUSED).items())
def test_a_case_is_answered_or_refused_in_a_line(command, told, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(CASES)
    output = ["--output", str(tmp_path / "t.npz")] if command.startswith("calibrate") else []
    assert main([*command.split(), *output]) == (2 if command in REFUSED else 0)
    out, err = capsys.readouterr()
    assert told in (err if command in REFUSED else out)
    assert err.count("\n") == (command in REFUSED)
