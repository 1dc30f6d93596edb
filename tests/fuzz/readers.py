"""Every reader of files: how a valid file is made, how it is read, what a result has to be.

A new reader is one entry of `READERS`.
"""

import json
import math
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

ROOT = Path(__file__).parents[2]
IDS = tuple(f"mug-{i}" for i in range(6))


@dataclass(frozen=True)
class Reader:
    """How to fuzz one kind of file.

    Attributes
    ----------
    file : str
        Its path below a case's folder.
    make : callable
        Writes a valid file to a path, and next to it whatever else reading needs.
    read : callable
        Reads it as the project does.
    problem : callable
        Returns what is wrong with a result, or nothing.
    """

    file: str
    make: Callable[[Path], object]
    read: Callable[[Path], Any]
    problem: Callable[[Any], str]


# Meshes


def dataset(name: str, root: Path) -> Any:
    from nbv.data.sources import open_source

    settings = yaml.safe_load((ROOT / "config" / "dataset" / f"{name}.yaml").read_text())
    return open_source({**settings, "root": str(root)}, 0)


def make_mesh(path: Path, **options: Any) -> None:
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=1)
    mesh.apply_scale((1.0, 2.0, 3.0))
    mesh.export(path, **options)


def make_hand_written_obj(path: Path) -> None:
    faces = (
        "g a\nusemtl red\nf 1/1/1 2/1/1 3/1/1\nf 1/1/1 3/1/1 4/1/1\ng b\nf -1//-1 -2//-1 -5//-1\n"
    )
    vertices = "v 0 0 0\nv 1 0 0.5\nv 1 1 0\nv 0 1 0\nv .5 .5 1\nvt 0 0\nvn 0 0 1\n"
    path.write_text(f"# by hand\nmtllib none.mtl\no thing\n{vertices}{faces}")


def make_ascii_stl(path: Path) -> None:
    import trimesh

    path.write_text(trimesh.exchange.stl.export_stl_ascii(trimesh.creation.box()))


def make_two_parts(path: Path) -> None:
    import trimesh

    move = trimesh.transformations.translation_matrix([2.0, 0.0, 0.0])
    scene = trimesh.Scene(trimesh.creation.box())
    scene.add_geometry(trimesh.creation.icosphere(subdivisions=1), transform=move)
    path.write_bytes(scene.export(file_type="glb"))


def read_mesh(path: Path) -> Any:
    return dataset("folder", path.parent.parent).load("mug", path.stem)


def mesh_problem(mesh: Any) -> str:
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if not np.isfinite(vertices).all():
        return "a vertex is not finite"
    if not math.isclose(np.linalg.norm(np.ptp(vertices, axis=0)), 1.0, rel_tol=1e-4):
        return "the diagonal is not 1"
    if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
        return "a face has no vertices"
    sides = vertices[faces[:, 1:]] - vertices[faces[:, :1]]
    return "" if np.cross(sides[:, 0], sides[:, 1]).any() else "no area"


def meshes_problem(meshes: Mapping[str, Any]) -> str:
    return next(filter(None, map(mesh_problem, meshes.values())), "")


def make_meshes(path: Path) -> None:
    import trimesh

    from nbv.data.meshes import normalise, save_meshes

    box = normalise(trimesh.creation.box((1, 2, 3)), "+z", "+x", 0.0, "box")
    ball = normalise(trimesh.creation.icosphere(subdivisions=1), "+z", "+x", 0.0, "box")
    save_meshes(path, {"box": box, "ball": ball})


def read_meshes(path: Path) -> Any:
    from nbv.data.meshes import load_meshes

    return load_meshes(path)


def make_metadata(path: Path) -> None:
    (path.parent / "models").mkdir(exist_ok=True)
    rows = "".join(f'wss.{name},"Mug,Cup",3797390,"0\\,0\\,1",\n' for name in IDS)
    path.write_text(f"fullId,category,wnsynset,up,front\n{rows}")
    for name in IDS:
        (path.parent / "models" / f"{name}.obj").write_text("")


def read_metadata(path: Path) -> Any:
    source = dataset("shapenet", path.parent)
    return [(name, source.mesh_axes("mug", name)) for name in source.object_ids("mug")]


def metadata_problem(objects: Any) -> str:
    return "" if {name for name, _ in objects} <= set(IDS) else f"objects {objects}"


# Tables


def make_splits(path: Path) -> None:
    from nbv.experiment.splits import make_splits as divide
    from nbv.files import write_csv

    write_csv(path, divide(IDS, 3, 0.3, np.random.default_rng(0)))


def read_splits(path: Path) -> Any:
    from nbv.experiment import splits

    return splits.read_splits(path)


def splits_problem(splits: pd.DataFrame) -> str:
    if set(splits["fold"]) != {1, 2, 3}:
        return f"folds {sorted(set(splits['fold']), key=str)}"
    for fold, rows in splits.groupby("fold"):
        if len(rows) != rows["object_id"].nunique():
            return f"fold {fold} has an object twice"
    of_fold = [frozenset(rows["object_id"]) for _, rows in splits.groupby("fold")]
    if len(set(of_fold)) > 1:
        return "folds have different objects"
    tested = splits.loc[splits["role"] == "test", "object_id"]
    return "" if sorted(tested) == sorted(of_fold[0]) else "objects are not tested once each"


def make_estimates(path: Path) -> None:
    from nbv.core.circle.estimates import Estimates
    from nbv.experiment.estimates import write_estimates

    estimate_deg = np.random.default_rng(0).uniform(0, 360, (len(IDS), 8))
    write_estimates(path, Estimates(IDS, estimate_deg))


def read_estimates(path: Path) -> Any:
    from nbv.experiment import estimates

    return estimates.read_estimates(path)


def estimates_problem(estimates: Any) -> str:
    values = estimates.estimate_deg
    if not values.size or len(set(estimates.object_ids)) != len(values):
        return f"{len(set(estimates.object_ids))} objects, {values.shape} estimates"
    return "" if ((values >= 0) & (values < 360)).all() else "an estimate beyond [0, 360)"


def make_evaluation(path: Path) -> None:
    from nbv.core.circle.estimates import Estimates
    from nbv.experiment.results import evaluate_method
    from nbv.files import write_csv

    rng = np.random.default_rng(0)
    test = Estimates(IDS, rng.uniform(0, 360, (len(IDS), 8)))
    write_csv(path, evaluate_method({"policy": "opposite", "fusion": "average"}, test))


def read_evaluation(path: Path) -> Any:
    from nbv.experiment import results

    return results.read_evaluation(path)


def evaluation_problem(rows: pd.DataFrame) -> str:
    errors = pd.to_numeric(rows["error_deg"], errors="coerce")
    return "" if len(rows) and errors.between(0, 180).all() else "an error beyond [0, 180]"


def make_claims(path: Path) -> None:
    shutil.copy(ROOT / "docs" / "reference" / "paper" / "claims.csv", path)


def read_claims(path: Path) -> Any:
    from nbv.experiment.run.reference import read_verdicts

    return read_verdicts(path.parent)


def claims_problem(verdicts: Mapping[str, str]) -> str:
    known = {"holds", "does not hold", "undecided", "not run"}
    return "" if verdicts and set(verdicts.values()) <= known else f"verdicts {verdicts}"


# Arrays


def densities(n_bins: int) -> np.ndarray:
    made = np.random.default_rng(0).uniform(0.5, 1.5, (n_bins, n_bins))
    return made / made.sum(axis=1, keepdims=True)


def make_lookup(path: Path) -> None:
    from nbv.core.circle.lookup import least_cost_delta
    from nbv.tables.lookup import LookupTable

    table = densities(36).astype(np.float32)
    settings = 8.0, 10.0, "given_estimate", "entropy", "pose_ambiguity"
    LookupTable(table, table, table, least_cost_delta(table), *settings).save(path)


def read_lookup(path: Path) -> Any:
    from nbv.tables.lookup import LookupTable

    return LookupTable.load(path)


def lookup_problem(table: Any) -> str:
    for rows in (table.viewpoint_likelihood, table.estimate_likelihood):
        if rows.shape != table.cost.shape or not np.allclose(rows.sum(axis=1), 1.0, atol=1e-4):
            return "a distribution does not sum to 1"
        if (rows < 0).any():
            return "a probability below 0"
    if not np.isfinite(table.cost).all():
        return "a cost is not finite"
    deltas = table.recommended_delta_deg
    is_degrees = deltas.shape == table.cost.shape[:1] and ((deltas >= 0) & (deltas < 360)).all()
    return "" if is_degrees else "a rotation beyond [0, 360)"


def make_posteriors(path: Path) -> None:
    from nbv.core.circle.estimates import posteriors_of
    from nbv.experiment.estimates import write_posteriors

    logits = np.random.default_rng(0).normal(size=(len(IDS), 8, 36))
    write_posteriors(path, posteriors_of(IDS, logits, 1.3))


def read_posteriors(path: Path) -> Any:
    from nbv.experiment import estimates

    return estimates.read_posteriors(path, IDS)


def posteriors_problem(posteriors: Any) -> str:
    if posteriors.log_posterior.ndim != 3 or len(posteriors.log_posterior) != len(IDS):
        return f"shape {posteriors.log_posterior.shape}"
    if not 0.0 < posteriors.temperature < math.inf:
        return f"temperature {posteriors.temperature}"
    sums = posteriors.distributions.sum(axis=-1)
    return "" if np.allclose(sums, 1.0, atol=1e-3) else "a distribution does not sum to 1"


def make_depth(path: Path) -> None:
    from nbv.data.depth_images import write_depth

    codes = np.random.default_rng(0).integers(0, 256, (len(IDS), 8, 6, 6), dtype=np.uint8)
    write_depth(path.with_suffix(".npy"), path.with_suffix(".json"), IDS, codes, codes.shape[1:])


def read_depth(path: Path) -> Any:
    from nbv.data.depth_images import open_depth

    images = open_depth(path.with_suffix(".npy"), path.with_suffix(".json"))
    return images._replace(codes=np.asarray(images.codes))


def depth_problem(images: Any) -> str:
    codes, ids = images.codes, images.object_ids
    is_images = codes.ndim == 4 and codes.dtype == np.uint8 and codes.shape[2] == codes.shape[3]
    is_whole = is_images and len(set(ids)) == len(codes) and all(isinstance(i, str) for i in ids)
    return "" if is_whole else f"{codes.dtype} {codes.shape} of {ids}"


def make_estimator(path: Path) -> None:
    import torch

    from nbv.experiment.estimation.hardware import choose_hardware
    from nbv.experiment.estimation.networks import build_network
    from nbv.experiment.estimation.weights import Estimator, save_estimator

    torch.manual_seed(0)
    settings = yaml.safe_load((ROOT / "config" / "estimator" / "regressor.yaml").read_text())
    network = build_network(settings, 16)
    save_estimator(path, Estimator(network, settings, 16, IDS), choose_hardware("cpu"))


def read_estimator(path: Path) -> Any:
    from nbv.experiment.estimation.hardware import choose_hardware
    from nbv.experiment.estimation.weights import load_estimator

    return load_estimator(path, choose_hardware("cpu"))


def estimator_problem(estimator: Any) -> str:
    weights = estimator.network.state_dict()
    broken = [name for name, tensor in weights.items() if not tensor.isfinite().all()]
    return f"{broken[0]} is not finite" if broken else ""


# Masks and cameras


def make_mask(path: Path, mode: str = "L") -> None:
    from PIL import Image

    labels = np.zeros((40, 60), dtype=np.uint8)
    labels[6:30, 8:30], labels[10:30, 30:50] = 1, 2
    if path.suffix == ".npy":
        np.save(path, labels / 2)
    else:
        Image.fromarray(labels).convert(mode).save(path)


def read_first_label(path: Path) -> Any:
    from nbv.frames.depth_files import read_mask

    return read_mask(path, 1)


def read_any_mask(path: Path) -> Any:
    from nbv.frames.depth_files import read_mask

    return read_mask(path)


def mask_problem(mask: Any) -> str:
    return "" if mask.dtype == bool and mask.ndim == 2 else f"{mask.dtype} {mask.shape}"


def make_camera(path: Path) -> None:
    roi = {"x_offset": 10, "y_offset": 20, "width": 300, "height": 200}
    k = [585.0, 0.0, 319.5, 0.0, 585.0, 239.5, 0.0, 0.0, 1.0]
    info = {"width": 640, "height": 480, "k": k, "binning_x": 2, "binning_y": 2, "roi": roi}
    path.write_text(yaml.safe_dump(info))


def read_camera(path: Path) -> Any:
    from nbv.frames.intrinsics import camera_of

    return camera_of(str(path))


def camera_problem(camera: Any) -> str:
    found = camera.intrinsics
    return "" if min(found.fx, found.fy) > 0 and math.isfinite(found.fx * found.fy) else f"{found}"


# Settings


def make_configuration(path: Path) -> None:
    shutil.copy(ROOT / "docs" / "reference" / "paper" / "configuration.yaml", path)


def read_run_configuration(path: Path) -> Any:
    from nbv.experiment.config import read_configuration

    return read_configuration(path.parent)


def configuration_problem(settings: Mapping[str, Any]) -> str:
    return "" if isinstance(settings.get("n_folds"), int) else "no folds"


def make_config(path: Path) -> None:
    shutil.copytree(ROOT / "config", path.parent, dirs_exist_ok=True)


def read_config(path: Path) -> Any:
    from nbv.experiment.config import load_config

    return load_config(path.parent)


def config_problem(value: Any) -> str:
    if isinstance(value, Mapping):
        value = list(value.values())
    if isinstance(value, list | tuple):
        return next(filter(None, map(config_problem, value)), "")
    return f"{value}" if isinstance(value, float) and not math.isfinite(value) else ""


def of_mesh(name: str, make: Callable[[Path], object]) -> Reader:
    return Reader(f"mug/{name}", make, read_mesh, mesh_problem)


def make_bop_results(path: Path) -> None:
    from examples.bop_example import write_example

    write_example(path.parent)


def make_bop_models(path: Path) -> None:
    make_bop_results(path)
    matrices = [[-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]]
    axes = [{"axis": [0, 0, 1], "offset": [0, 0, 0]}]
    entries = [{"symmetries_discrete": matrices}, {"symmetries_continuous": axes}]
    path.write_text(json.dumps({"1": {"diameter": 100.0, **entries[0], **entries[1]}}))


def make_bop_truth(path: Path) -> None:
    make_bop_results(path.parent)


def read_bop_results(path: Path) -> Any:
    from nbv.tables.bop import read_orientation_table

    return read_orientation_table(
        path.parent / "results.csv", None, path.parent / "models_info.json"
    )


def read_bop_truth(path: Path) -> Any:
    return read_bop_results(path.parent)


def bop_problem(result: Any) -> str:
    determinant = np.linalg.det(np.concatenate([result.estimate, result.truth]))
    return "" if np.allclose(determinant, 1.0, atol=0.01) else "a matrix is no rotation"


STAMPED = """header:
  frame_id: camera_optical_frame
pose:
  position: {x: 0.1, y: 0.0, z: 0.7}
  orientation:
    x: 0.0
    y: 0.6
    z: 0.0
    w: 0.8
---
"""


def make_pose(path: Path) -> None:
    rotation = [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]
    pose = np.block([[np.array(rotation), np.array([[0.1, 0.0, 0.7]]).T], [0, 0, 0, 1]])
    view = {"R": rotation, "t": [100.0, 0.0, 700.0], "score": 0.4, "camera_pose": pose.tolist()}
    bop = {"cam_R_m2c": np.ravel(rotation).tolist(), "cam_t_m2c": [0, 0, 700.0], "obj_id": 1}
    turned = {"position": [0, 0, 0.7], "quaternion_wxyz": [0.8, 0, 0.6, 0]}
    text = {
        ".json": json.dumps([view, bop, turned, {"pose": pose.tolist(), "score": 1}]),
        ".yaml": 2 * STAMPED,
        ".txt": "\n".join(" ".join(map(str, row)) for row in [*pose, *pose]),
    }
    if path.suffix in text:
        path.write_text(text[path.suffix])
    else:
        np.save(path, np.stack([pose] * 3))


def read_estimates_6d(path: Path) -> Any:
    from nbv.tables.next_camera import read_views

    return [view.rotation for view in read_views(path)]


def read_camera_poses(path: Path) -> Any:
    from nbv.poses import read_poses

    return [pose[:3, :3] for pose in read_poses(path)]


def rotations_problem(rotations: Any) -> str:
    is_right = rotations and np.allclose(np.linalg.det(np.stack(rotations)), 1.0, atol=0.01)
    return "" if is_right else "a matrix is no rotation"


def of_poses(name: str, read: Callable[[Path], Any] = read_estimates_6d) -> Reader:
    return Reader(name, make_pose, read, rotations_problem)


def make_rotation_table(path: Path) -> None:
    make_bop_results(path.parent / "results.csv")
    read_bop_results(path.parent / "results.csv").save(path)


def read_rotation_table(path: Path) -> Any:
    from nbv.tables.orientation_table import OrientationTable

    return OrientationTable.load(path)


READERS: Mapping[str, Reader] = {
    "bop results": Reader("results.csv", make_bop_results, read_bop_results, bop_problem),
    "bop models": Reader("models_info.json", make_bop_models, read_bop_results, bop_problem),
    "bop truth": Reader("000001/scene_gt.json", make_bop_truth, read_bop_truth, bop_problem),
    "rotations": Reader("t.npz", make_rotation_table, read_rotation_table, bop_problem),
    "estimate json": of_poses("e.json"),
    "estimate yaml": of_poses("e.yaml"),
    "estimate text": of_poses("e.txt"),
    "estimate npy": of_poses("e.npy"),
    "camera yaml": of_poses("c.yaml", read_camera_poses),
    "camera text": of_poses("c.txt", read_camera_poses),
    "camera npy": of_poses("c.npy", read_camera_poses),
    "mask labels": Reader("m.png", make_mask, read_first_label, mask_problem),
    "mask palette": Reader(
        "m.png", lambda path: make_mask(path, "P"), read_first_label, mask_problem
    ),
    "mask colours": Reader(
        "m.png", lambda path: make_mask(path, "RGBA"), read_first_label, mask_problem
    ),
    "mask array": Reader("m.npy", make_mask, read_any_mask, mask_problem),
    "camera": Reader("info.yaml", make_camera, read_camera, camera_problem),
    "obj": of_mesh("one.obj", make_mesh),
    "obj by hand": of_mesh("one.obj", make_hand_written_obj),
    "ply ascii": of_mesh("one.ply", lambda path: make_mesh(path, encoding="ascii")),
    "ply binary": of_mesh("one.ply", make_mesh),
    "off": of_mesh("one.off", make_mesh),
    "stl ascii": of_mesh("one.stl", make_ascii_stl),
    "stl binary": of_mesh("one.stl", make_mesh),
    "glb": of_mesh("one.glb", make_two_parts),
    "metadata": Reader("metadata.csv", make_metadata, read_metadata, metadata_problem),
    "meshes": Reader("mug.npz", make_meshes, read_meshes, meshes_problem),
    "splits": Reader("mug.csv", make_splits, read_splits, splits_problem),
    "estimates": Reader("mug.csv", make_estimates, read_estimates, estimates_problem),
    "evaluation": Reader("mug.csv", make_evaluation, read_evaluation, evaluation_problem),
    "claims": Reader("claims.csv", make_claims, read_claims, claims_problem),
    "lookup": Reader("mug.npz", make_lookup, read_lookup, lookup_problem),
    "posteriors": Reader("mug.npz", make_posteriors, read_posteriors, posteriors_problem),
    "depth": Reader("mug.npy", make_depth, read_depth, depth_problem),
    "depth objects": Reader("mug.json", make_depth, read_depth, depth_problem),
    "estimator": Reader("e.safetensors", make_estimator, read_estimator, estimator_problem),
    "configuration": Reader(
        "configuration.yaml", make_configuration, read_run_configuration, configuration_problem
    ),
    "config": Reader("config.yaml", make_config, read_config, config_problem),
}
