"""What the sources of files have in common: reading, exclusions, and messages about bad files."""

import logging
import os

import numpy as np
import pandas as pd
import pytest
import trimesh

from mesh_files import READER, REAL, needs_real, pointer, points_to, put, refused, source_of
from nbv.data.sources import prepare_meshes, select_objects
from nbv.data.sources.files import EXTENSIONS
from nbv.files import read_csv, write_csv


def test_the_parts_of_a_scene_keep_their_places(tmp_path):
    scene = trimesh.Scene()
    ball = trimesh.creation.icosphere(subdivisions=1)
    for x in (-3.0, 5.0):
        scene.add_geometry(ball, transform=trimesh.transformations.translation_matrix([x, 0, 0]))
    scene.export(tmp_path / "two.glb")
    mesh = READER.read(tmp_path / "two.glb")
    assert len(mesh.faces) == 2 * len(ball.faces)
    assert np.allclose(mesh.bounds[:, 0], [-4.0, 6.0])


def test_materials_and_their_absence_are_passed_over_in_silence(tmp_path, caplog):
    file = put(tmp_path / "mug" / "one.obj", trimesh.creation.box())
    file.write_text("mtllib not/there.mtl\nusemtl gone\n" + file.read_text())
    with caplog.at_level(logging.DEBUG):
        source_of("folder", root=str(tmp_path)).load("mug", "one")
    assert not caplog.records


def test_two_files_of_one_name_are_both_named(tmp_path):
    paths = [put(tmp_path / "mug" / f"one.{extension}") for extension in ("obj", "ply")]
    refused(lambda: source_of("folder", root=str(tmp_path)).object_ids("mug"), *paths)


def test_an_unknown_object_is_named(tmp_path):
    put(tmp_path / "mug" / "one.ply")
    source = source_of("folder", root=str(tmp_path))
    refused(lambda: source.load("mug", "two"), "two", tmp_path / "mug")


def test_axes_without_sense_are_named_with_the_file(tmp_path):
    path = put(tmp_path / "mug" / "one.ply")
    source = source_of("folder", root=str(tmp_path), up="+y", front="+y")
    refused(lambda: source.load("mug", "one"), path, "up=+y, front=+y", "perpendicular")


def empty(path):
    path.write_bytes(b"")


def no_faces_ply(path):
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 0\n"
    )


def truncated(path):
    put(path)
    path.write_bytes(path.read_bytes()[:-200])


def truncated_text(path):
    pointer().export(path, encoding="ascii")
    path.write_bytes(path.read_bytes()[:-20])


def garbage(path):
    path.write_bytes(np.random.default_rng(0).bytes(500))


@pytest.mark.parametrize(
    ("extension", "spoil"),
    [
        *[("obj", spoil) for spoil in (empty, garbage)],
        *[("ply", spoil) for spoil in (empty, no_faces_ply, truncated, truncated_text, garbage)],
        *[("glb", spoil) for spoil in (empty, truncated, garbage)],
        *[("off", spoil) for spoil in (empty, garbage, truncated)],
        *[("stl", spoil) for spoil in (empty, garbage, truncated)],
    ],
)
def test_a_bad_file_is_named_in_one_line(tmp_path, extension, spoil):
    path = tmp_path / "mug" / f"bad.{extension}"
    path.parent.mkdir()
    spoil(path)
    source = source_of("folder", root=str(tmp_path))
    message = refused(lambda: source.load("mug", "bad"), path)
    assert message.startswith(str(path))


@pytest.fixture
def root(tmp_path):
    for name in ("a", "b", "c"):
        put(tmp_path / "mug" / f"{name}.ply", trimesh.creation.box())
    return tmp_path


def test_ids_are_left_out_by_list_and_by_file(root):
    listed = root / "leave_out.txt"
    listed.write_text("# mugs without a handle\n\nb  # broken off\n")
    source = source_of("folder", root=str(root), exclude=["a"], exclude_file=str(listed))
    assert source.object_ids("mug") == ["c"]
    refused(lambda: select_objects(source, "mug", 2), "holds 1 usable meshes")


def test_a_misspelt_id_among_good_ones_is_warned_of(root, caplog):
    assert source_of("folder", root=str(root), exclude=["a", "z"]).object_ids("mug")
    assert "1 listed exclusions are not among the files of mug, the first is z" in caplog.text


def test_a_list_for_other_categories_is_none_of_this_one_s_business(root, caplog):
    source = source_of("folder", root=str(root), exclude=["x", "z"])
    assert source.object_ids("mug") == ["a", "b", "c"]
    assert not caplog.records


def test_a_missing_list_is_named(root):
    path = root / "no.txt"
    refused(lambda: source_of("folder", root=str(root), exclude_file=str(path)), path)


@pytest.mark.parametrize("name", [b"two\nlines", b"return\r", b"tab\t", b"latin \xe9", b"bell\x07"])
def test_names_that_would_break_a_table_or_a_line_are_refused(tmp_path, name):
    put(tmp_path / "mug" / "one.ply")
    (tmp_path / "mug" / os.fsdecode(name + b".ply")).write_bytes(b"")
    message = refused(lambda: source_of("folder", root=str(tmp_path)).object_ids("mug"), "rename")
    assert message.isascii()
    assert message.isprintable()


def test_names_with_spaces_commas_and_quotes_work(tmp_path):
    names = ["a, b", "c 'd' \"e\"", "{f} %g $h", "Täße", "#i;j", "k" * 200]
    for i, name in enumerate(names):
        put(tmp_path / "mug" / f"{name}.ply", trimesh.creation.box((1, 1 + i, 1)))
    source = source_of("folder", root=str(tmp_path))
    assert source.object_ids("mug") == sorted(names)
    assert list(prepare_meshes(source, "mug", names)) == names


def test_names_with_spaces_commas_and_quotes_survive_a_table(tmp_path):
    names = ["a, b", "c 'd' \"e\"", "{f} %g $h", "Täße", " #i;j ", "NA", "007"]
    write_csv(tmp_path / "t.csv", pd.DataFrame({"object_id": names, "fold": 1}))
    assert list(read_csv(tmp_path / "t.csv")["object_id"]) == names


def test_a_pipe_among_the_meshes_is_named_and_not_opened(tmp_path):
    put(tmp_path / "mug" / "one.ply")
    os.mkfifo(tmp_path / "mug" / "pipe.ply")
    source = source_of("folder", root=str(tmp_path))
    refused(lambda: source.object_ids("mug"), tmp_path / "mug" / "pipe.ply", "not a regular file")
    listed = tmp_path / "list"
    os.mkfifo(listed)
    refused(lambda: source_of("folder", root=str(tmp_path), exclude_file=str(listed)), listed)


def test_a_category_without_meshes_is_named(tmp_path):
    (tmp_path / "mug").mkdir()
    source = source_of("folder", root=str(tmp_path))
    refused(lambda: select_objects(source, "mug", None), tmp_path / "mug", "no usable meshes")


@pytest.mark.parametrize("name", ["folder", "shapenet", "modelnet"])
def test_paths_that_the_system_refuses_are_named(tmp_path, name):
    long = str(tmp_path / ("x" * 300))
    refused(lambda: source_of(name, root=long).object_ids("mug"), "xxx", "too long")
    labelled = source_of(name, root=str(tmp_path), categories={"mug": "y" * 300})
    refused(lambda: labelled.object_ids("mug"), "yyy", "too long")


def test_a_list_of_exclusions_without_an_end_is_not_read(root):
    """A device or a pipe; the empty device stands for those that would fill the memory."""
    refused(
        lambda: source_of("folder", root=str(root), exclude_file="/dev/null"), "not a regular file"
    )


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_each_format_is_read_checked_and_normalised(tmp_path, extension):
    put(tmp_path / "mug" / f"one{extension}", pointer((0, 0, 1)))
    source = source_of("folder", root=str(tmp_path))
    assert source.object_ids("mug") == ["one"]
    mesh = source.load("mug", "one")
    assert len(mesh.faces) == 24
    assert np.isclose(np.linalg.norm(np.ptp(mesh.vertices, axis=0)), 1.0)
    assert points_to(mesh) == "+x"


def test_other_files_and_letter_case_do_not_matter(tmp_path):
    put(tmp_path / "mug" / "one.ply").rename(tmp_path / "mug" / "one.PLY")
    (tmp_path / "mug" / "README.txt").write_text("not a mesh")
    source = source_of("folder", root=str(tmp_path))
    assert source.object_ids("mug") == ["one"]
    source.load("mug", "one")


def test_a_category_may_have_another_folder_and_front(tmp_path):
    put(tmp_path / "cups" / "one.ply", pointer((0, 0, 1)))
    source = source_of(
        "folder", root=str(tmp_path), categories={"mug": "cups"}, turn_deg={"mug": 270}
    )
    assert points_to(source.load("mug", "one")) == "-y"


def test_a_relative_root_is_below_the_working_directory(tmp_path, monkeypatch):
    put(tmp_path / "data" / "mug" / "one.ply")
    monkeypatch.chdir(tmp_path)
    assert source_of("folder", root="data").object_ids("mug") == ["one"]


def test_missing_folders_are_named(tmp_path):
    nowhere = tmp_path / "nowhere"
    refused(lambda: source_of("folder", root=None), "dataset.root is not set")
    source = source_of("folder", root=str(nowhere))
    refused(lambda: source.object_ids("mug"), nowhere, "does not exist", "dataset.root")
    source = source_of("folder", root=str(tmp_path))
    absent = (tmp_path / "mug", "does not exist", "out of categories")
    refused(lambda: source.object_ids("mug"), *absent)
    (tmp_path / "mug").write_text("")
    refused(lambda: source.object_ids("mug"), tmp_path / "mug", "is not a folder")


@needs_real
def test_real_toilets_have_their_cisterns_behind():
    source = source_of("folder", root=str(REAL / "meshes"))
    for object_id in source.object_ids("toilet"):
        vertices = np.asarray(source.load("toilet", object_id).vertices)
        top = vertices[vertices[:, 2] > np.quantile(vertices[:, 2], 0.9)]
        assert top[:, 0].mean() < 0


def test_both_parts_and_the_mugs_other_name(tmp_path):
    put(tmp_path / "cup" / "train" / "cup_0001.off", pointer((0, -1, 0)))
    put(tmp_path / "cup" / "test" / "cup_0080.off", pointer((0, -1, 0)))
    source = source_of("modelnet", root=str(tmp_path))
    assert source.object_ids("mug") == ["cup_0001", "cup_0080"]
    assert points_to(source.load("mug", "cup_0080")) == "-y"


@pytest.mark.parametrize("header", ["OFF4 4 0", "OFF 4 4 0", "OFF\n4 4 0", "OFF\n# c\n\n4 4 0"])
def test_counts_glued_to_the_header_are_read(tmp_path, header):
    path = tmp_path / "chair" / "train" / "chair_0001.off"
    path.parent.mkdir(parents=True)
    body = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"
    path.write_text(f"{header}\n{body}")
    mesh = source_of("modelnet", root=str(tmp_path)).load("chair", "chair_0001")
    assert mesh.is_watertight
    assert len(mesh.vertices) == len(mesh.faces) == 4


def test_missing_folders_of_modelnet_are_named(tmp_path):
    (tmp_path / "chair").mkdir()
    source = source_of("modelnet", root=str(tmp_path))
    refused(lambda: source.object_ids("chair"), tmp_path / "chair", "train", "test")
    refused(lambda: source.object_ids("car"), tmp_path / "car", "does not exist")


class TestShapeNetCore:
    def tree(self, root, layout, n=3, synset="03797390"):
        for i in range(n):
            folder = root / synset / f"id{i}"
            file = folder / ("model.obj" if layout == "v1" else "models/model_normalized.obj")
            put(file, pointer((1, 0, 0) if layout == "v1" else (0, 0, -1)))
        return root

    @pytest.mark.parametrize("layout", ["v1", "v2"])
    @pytest.mark.parametrize("told", [True, False])
    def test_its_front_goes_to_plus_x_and_a_mugs_to_270_degrees(self, tmp_path, layout, told):
        self.tree(tmp_path, layout)
        self.tree(tmp_path, layout, synset="02958343")
        chosen = layout if told else "auto"
        source = source_of("shapenet", root=str(tmp_path), layout=chosen)
        assert source.object_ids("mug") == ["id0", "id1", "id2"]
        assert points_to(source.load("car", "id1")) == "+x"
        assert points_to(source.load("mug", "id0")) == "-y"

    def test_axes_of_the_configuration_come_first(self, tmp_path):
        self.tree(tmp_path, "v2")
        source = source_of("shapenet", root=str(tmp_path), up="+y", front="+z", turn_deg={})
        assert points_to(source.load("mug", "id0")) == "-x"

    def test_a_model_without_a_file_is_refused_unless_it_is_excluded(self, tmp_path):
        self.tree(tmp_path, "v2")
        (tmp_path / "03797390" / "hollow").mkdir()
        source = source_of("shapenet", root=str(tmp_path))
        refused(lambda: source.object_ids("mug"), tmp_path / "03797390" / "hollow", "exclude")
        source = source_of("shapenet", root=str(tmp_path), exclude=["hollow"])
        assert source.object_ids("mug") == ["id0", "id1", "id2"]

    def test_there_are_no_toilets(self, tmp_path):
        self.tree(tmp_path, "v2")
        source = source_of("shapenet", root=str(tmp_path))
        refused(lambda: source.object_ids("toilet"), "ShapeNetCore has no toilet", "layout=sem")

    def test_a_missing_synset_is_named(self, tmp_path):
        self.tree(tmp_path, "v2")
        source = source_of("shapenet", root=str(tmp_path))
        refused(lambda: source.object_ids("chair"), tmp_path / "03001627", "dataset.categories")


class TestShapeNetSem:
    METADATA = (
        "fullId,category,wnsynset,wnlemmas,up,front,unit\n"
        'wss.aa,"Mug,DrinkingUtensil",n03797390,mug,,,0.01\n'
        r'wss.bb,Toilet,n04446521,"toilet,can","0.0\,1.0\,0.0","0.0\,0.0\,1.0",0.02'
        "\n"
        "wss.cc,Toilet,n04446521,toilet,,,0.02\n"
        "wss.dd,Cup,03797390,mug,,,\n"
    )

    @pytest.fixture
    def root(self, tmp_path):
        (tmp_path / "metadata.csv").write_text(self.METADATA)
        for name, towards in (("aa", (0, -1, 0)), ("bb", (0, 0, 1)), ("dd", (0, -1, 0))):
            put(tmp_path / "models" / f"{name}.obj", pointer(towards))
        return tmp_path

    def test_categories_are_found_by_name_and_by_synset(self, root):
        source = source_of("shapenet", root=str(root), exclude=["cc"])
        assert source.object_ids("mug") == ["aa", "dd"]
        assert source.object_ids("toilet") == ["bb"]

    def test_each_model_has_its_own_axes_or_the_default(self, root):
        source = source_of("shapenet", root=str(root))
        assert points_to(source.load("toilet", "bb")) == "+x"
        assert points_to(source.load("mug", "aa")) == "-y"

    def test_the_models_may_lie_where_the_archive_puts_them(self, root):
        (root / "models-OBJ").mkdir()
        (root / "models").rename(root / "models-OBJ" / "models")
        assert source_of("shapenet", root=str(root)).object_ids("mug") == ["aa", "dd"]

    def test_what_is_missing_is_named(self, root):
        source = source_of("shapenet", root=str(root))
        refused(lambda: source.object_ids("toilett"), "metadata.csv", "did you mean 'toilet'")
        refused(lambda: source.object_ids("zeppelin"), "no category zeppelin", "column category")
        (root / "metadata.csv").write_text("id,label\n1,mug\n")
        source = source_of("shapenet", root=str(root))
        refused(lambda: source.object_ids("mug"), "metadata.csv", "no column category")
        (root / "metadata.csv").unlink()
        source = source_of("shapenet", root=str(root), layout="sem")
        refused(lambda: source.object_ids("mug"), root / "metadata.csv", "does not exist")

    @pytest.mark.parametrize(
        ("content", "named"),
        [
            (b"fullId,category\n,mug\n", "row 1 has no fullId"),
            (b'fullId,category\nwss.aa,"mug' + b"x" * 200_000, "cannot be read"),
            (b"fullId,category\nwss./etc/passwd,mug\n", "'/etc/passwd' has '/' in it"),
        ],
    )
    def test_a_damaged_or_hostile_table_is_named(self, root, content, named):
        (root / "metadata.csv").write_bytes(content)
        source = source_of("shapenet", root=str(root))
        refused(lambda: source.object_ids("mug"), named)


@needs_real
def test_real_mugs_have_their_handles_at_270_degrees():
    source = source_of(
        "shapenet", root=str(REAL / "shapenet"), exclude_file=str(REAL / "mugs_to_leave_out.txt")
    )
    ids = source.object_ids("mug")
    assert len(ids) == 129
    for object_id in ids[::4]:
        vertices = np.asarray(source.load("mug", object_id).vertices)
        # The handle makes a mug longer along y than along x, and narrower at its end.
        assert np.ptp(vertices[:, 1]) > np.ptp(vertices[:, 0])
        ends = (
            [vertices[vertices[:, 1] < -0.9 * half], vertices[vertices[:, 1] > 0.9 * half]]
            if (half := np.ptp(vertices[:, 1]) / 2)
            else []
        )
        assert np.ptp(ends[0][:, 0]) < np.ptp(ends[1][:, 0])
