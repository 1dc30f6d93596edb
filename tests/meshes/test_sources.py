"""Each layout of files on disk, and each way in which it can be wrong."""

from __future__ import annotations

import logging
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest
import trimesh
from mesh_files import CONFIG, REAL, needs_real, pointer, points_to, put, settings_of, source_of

from nbv.errors import UserError
from nbv.meshes.sources import SOURCES, open_source, select_objects
from nbv.meshes.sources.files import EXTENSIONS, read_mesh
from nbv.meshes.sources.procedural import CATEGORIES


def refused(call, *named):
    with pytest.raises(UserError) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    for part in named:
        assert str(part) in message
    return message


# Choosing


def test_every_source_has_its_configuration_and_opens():
    assert {path.stem for path in CONFIG.glob("*.yaml")} == set(SOURCES)
    fields = set(settings_of("procedural"))
    for name in SOURCES:
        settings = settings_of(name, root="anywhere")
        assert set(settings) == fields
        assert open_source(settings, seed=3).name == settings["source"] == name
        assert open_source(settings, seed=3).seed == 3


def test_configurations_have_the_keys_of_the_schema():
    from nbv.config.schema import Dataset

    assert list(settings_of("procedural")) == list(Dataset.model_fields)


def test_an_unknown_source_is_named_with_the_nearest():
    settings = settings_of("folder", source="foldr")
    refused(lambda: open_source(settings, 0), "dataset.source=foldr", "did you mean 'folder'")


def test_listing_imports_no_mesh_library(tmp_path):
    put(tmp_path / "mug" / "a.ply")
    settings = settings_of("folder", root=str(tmp_path))
    program = (
        "import sys; from nbv.meshes.sources import open_source, select_objects\n"
        f"assert select_objects(open_source({settings!r}, 0), 'mug', 1) == ['a']\n"
        f"select_objects(open_source({settings_of('procedural')!r}, 0), 'mug', 5)\n"
        "heavy = {'trimesh', 'scipy', 'torch', 'pandas'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


class TestSelection:
    def ids(self, tmp_path, n, seed=0, n_files=40):
        for i in range(n_files):
            put(tmp_path / "mug" / f"m{i}.off", trimesh.creation.box())
        return select_objects(source_of("folder", seed, root=str(tmp_path)), "mug", n)

    def test_all_are_taken_where_none_are_counted(self, tmp_path):
        assert self.ids(tmp_path, None) == sorted(f"m{i}" for i in range(40))

    def test_the_choice_is_sorted_repeatable_and_the_seed_s(self, tmp_path):
        chosen = self.ids(tmp_path, 10)
        assert chosen == sorted(chosen)
        assert len(set(chosen)) == 10
        assert chosen == self.ids(tmp_path, 10)
        assert chosen != self.ids(tmp_path, 10, seed=1)

    def test_a_smaller_choice_is_part_of_a_larger(self, tmp_path):
        assert set(self.ids(tmp_path, 10)) < set(self.ids(tmp_path, 11))

    def test_a_new_file_displaces_at_most_one(self, tmp_path):
        before = set(self.ids(tmp_path, 10))
        after = set(self.ids(tmp_path, 10, n_files=41))
        assert len(before - after) <= 1
        assert after - before <= {"m40"}

    def test_all_are_equally_likely(self, tmp_path):
        drawn = Counter()
        for seed in range(200):
            drawn.update(self.ids(tmp_path, 4, seed, n_files=8 if seed == 0 else 0))
        assert set(drawn) == {f"m{i}" for i in range(8)}
        # Binomial(200, 1/2): five standard deviations are 35.
        assert all(abs(count - 100) < 36 for count in drawn.values())

    def test_too_few_say_where_how_many_and_what_to_do(self, tmp_path):
        message = refused(
            lambda: self.ids(tmp_path, 125, n_files=3), tmp_path / "mug", "n_objects=null"
        )
        assert "dataset=folder" in message
        assert "holds 3 usable meshes, n_objects=125 asked for" in message
        assert "set n_objects=3" in message
        assert all(extension in message for extension in EXTENSIONS)


# Made from the seed


class TestProcedural:
    def test_its_categories_are_the_generators(self):
        from nbv.meshes import procedural

        assert set(CATEGORIES) == set(procedural.CATEGORIES)

    def test_objects_are_the_first_so_many_and_the_exclusions_skipped(self):
        assert select_objects(source_of("procedural"), "mug", 3) == [
            *("mug-0000", "mug-0001", "mug-0002")
        ]
        source = source_of("procedural", exclude=["mug-0001"])
        assert select_objects(source, "mug", 2) == ["mug-0000", "mug-0002"]

    def test_an_object_depends_on_seed_and_number(self):
        one = source_of("procedural", seed=0).load("mug", "mug-0001")
        same = source_of("procedural", seed=0).load("mug", "mug-0001")
        other = source_of("procedural", seed=1).load("mug", "mug-0001")
        assert np.array_equal(one.vertices, same.vertices)
        assert not np.array_equal(one.vertices, other.vertices)
        assert np.isclose(np.linalg.norm(np.ptp(one.vertices, axis=0)), 1.0)

    def test_the_handle_is_at_270_degrees(self):
        vertices = np.asarray(source_of("procedural").load("mug", "mug-0000").vertices)
        radius = np.linalg.norm(vertices[:, :2], axis=1)
        farthest = vertices[radius.argmax()]
        assert abs(np.degrees(np.arctan2(farthest[1], farthest[0])) + 90) < 10

    def test_what_it_cannot_make_is_refused(self):
        source = source_of("procedural")
        refused(lambda: source.object_ids("mugg"), "no category mugg", "did you mean 'mug'")
        refused(lambda: select_objects(source, "mug", None), "set n_objects")
        refused(lambda: source.load("mug", "mug-x"), "mug-x is not an id like mug-0000")


# One's own files


class TestFolder:
    @pytest.mark.parametrize("extension", EXTENSIONS)
    def test_each_format_is_read_checked_and_normalised(self, tmp_path, extension):
        put(tmp_path / "mug" / f"one{extension}", pointer((0, 0, 1)))
        source = source_of("folder", root=str(tmp_path))
        assert source.object_ids("mug") == ["one"]
        mesh = source.load("mug", "one")
        assert len(mesh.faces) == 24
        assert np.isclose(np.linalg.norm(np.ptp(mesh.vertices, axis=0)), 1.0)
        assert points_to(mesh) == "+x"

    def test_the_parts_of_a_scene_keep_their_places(self, tmp_path):
        scene = trimesh.Scene()
        ball = trimesh.creation.icosphere(subdivisions=1)
        for x in (-3.0, 5.0):
            scene.add_geometry(
                ball, transform=trimesh.transformations.translation_matrix([x, 0, 0])
            )
        scene.export(tmp_path / "two.glb")
        mesh = read_mesh(tmp_path / "two.glb")
        assert len(mesh.faces) == 2 * len(ball.faces)
        assert np.allclose(mesh.bounds[:, 0], [-4.0, 6.0])

    def test_polygons_become_triangles(self, tmp_path):
        file = tmp_path / "square.off"
        file.write_text("OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n")
        assert np.isclose(read_mesh(file).area, 1.0)

    @pytest.mark.parametrize("n_characters", [1, 3, 10])
    def test_text_that_ends_early_is_noticed(self, tmp_path, n_characters):
        file = tmp_path / "square.off"
        file.write_text("OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"[:-1])
        read_mesh(file)
        file.write_text(file.read_text()[:-n_characters])
        refused(lambda: read_mesh(file), "5 of 6 lines", "cut short")

    def test_other_files_and_letter_case_do_not_matter(self, tmp_path):
        put(tmp_path / "mug" / "one.ply").rename(tmp_path / "mug" / "one.PLY")
        (tmp_path / "mug" / "README.txt").write_text("not a mesh")
        source = source_of("folder", root=str(tmp_path))
        assert source.object_ids("mug") == ["one"]
        source.load("mug", "one")

    def test_a_category_may_have_another_folder_and_a_turn(self, tmp_path):
        put(tmp_path / "cups" / "one.ply", pointer((0, 0, 1)))
        source = source_of(
            "folder", root=str(tmp_path), categories={"mug": "cups"}, turn_deg={"mug": 270}
        )
        assert points_to(source.load("mug", "one")) == "-y"

    def test_a_relative_root_is_below_the_working_directory(self, tmp_path, monkeypatch):
        put(tmp_path / "data" / "mug" / "one.ply")
        monkeypatch.chdir(tmp_path)
        assert source_of("folder", root="data").object_ids("mug") == ["one"]

    def test_materials_and_their_absence_are_passed_over_in_silence(self, tmp_path, caplog):
        file = put(tmp_path / "mug" / "one.obj", trimesh.creation.box())
        file.write_text("mtllib not/there.mtl\nusemtl gone\n" + file.read_text())
        with caplog.at_level(logging.DEBUG):
            source_of("folder", root=str(tmp_path)).load("mug", "one")
        assert not caplog.records

    def test_missing_folders_are_named(self, tmp_path):
        nowhere = tmp_path / "nowhere"
        refused(lambda: source_of("folder", root=None), "dataset.root is not set")
        source = source_of("folder", root=str(nowhere))
        refused(lambda: source.object_ids("mug"), nowhere, "does not exist", "dataset.root")
        source = source_of("folder", root=str(tmp_path))
        refused(lambda: source.object_ids("mug"), tmp_path / "mug", "does not exist")
        (tmp_path / "mug").write_text("")
        refused(lambda: source.object_ids("mug"), tmp_path / "mug", "is not a folder")

    def test_two_files_of_one_name_are_both_named(self, tmp_path):
        paths = [put(tmp_path / "mug" / f"one.{extension}") for extension in ("obj", "ply")]
        refused(lambda: source_of("folder", root=str(tmp_path)).object_ids("mug"), *paths)

    def test_an_unknown_object_is_named(self, tmp_path):
        put(tmp_path / "mug" / "one.ply")
        source = source_of("folder", root=str(tmp_path))
        refused(lambda: source.load("mug", "two"), "two", tmp_path / "mug")

    def test_axes_without_sense_are_named_with_the_file(self, tmp_path):
        path = put(tmp_path / "mug" / "one.ply")
        source = source_of("folder", root=str(tmp_path), up="+y", front="+y")
        refused(lambda: source.load("mug", "one"), path, "up=+y, front=+y", "perpendicular")


def nan_obj(path):
    path.write_text("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n")


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


def face_out_of_range(path):
    path.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n")


def no_extent(path):
    path.write_text("v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n")


@pytest.mark.parametrize(
    ("extension", "spoil"),
    [
        *[("obj", spoil) for spoil in (nan_obj, empty, garbage, no_extent)],
        *[("ply", spoil) for spoil in (empty, no_faces_ply, truncated, truncated_text, garbage)],
        *[("glb", spoil) for spoil in (empty, truncated, garbage)],
        *[("off", spoil) for spoil in (empty, face_out_of_range, garbage, truncated)],
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


class TestExclusions:
    @pytest.fixture
    def root(self, tmp_path):
        for name in ("a", "b", "c"):
            put(tmp_path / "mug" / f"{name}.ply", trimesh.creation.box())
        return tmp_path

    def test_ids_are_left_out_by_list_and_by_file(self, root):
        listed = root / "leave_out.txt"
        listed.write_text("# mugs without a handle\n\nb  # broken off\n")
        source = source_of("folder", root=str(root), exclude=["a"], exclude_file=str(listed))
        assert source.object_ids("mug") == ["c"]
        refused(lambda: select_objects(source, "mug", 2), "holds 1 usable meshes")

    def test_a_misspelt_id_among_good_ones_is_warned_of(self, root, caplog):
        assert source_of("folder", root=str(root), exclude=["a", "z"]).object_ids("mug")
        assert "1 listed exclusions are not among the files of mug, the first is z" in caplog.text

    def test_a_list_for_other_categories_is_none_of_this_one_s_business(self, root, caplog):
        source = source_of("folder", root=str(root), exclude=["x", "z"])
        assert source.object_ids("mug") == ["a", "b", "c"]
        assert not caplog.records

    def test_a_missing_list_is_named(self, root):
        path = root / "no.txt"
        refused(lambda: source_of("folder", root=str(root), exclude_file=str(path)), path)


# ShapeNet


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
        refused(lambda: source_of("shapenet", root="x", layout="v3"), "layout=v3")


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


# ModelNet


class TestModelNet:
    def test_both_parts_and_the_mugs_other_name(self, tmp_path):
        put(tmp_path / "cup" / "train" / "cup_0001.off", pointer((0, -1, 0)))
        put(tmp_path / "cup" / "test" / "cup_0080.off", pointer((0, -1, 0)))
        source = source_of("modelnet", root=str(tmp_path))
        assert source.object_ids("mug") == ["cup_0001", "cup_0080"]
        assert points_to(source.load("mug", "cup_0080")) == "-y"

    @pytest.mark.parametrize("header", ["OFF4 4 0", "OFF 4 4 0", "OFF\n4 4 0", "OFF\n# c\n\n4 4 0"])
    def test_counts_glued_to_the_header_are_read(self, tmp_path, header):
        path = tmp_path / "chair" / "train" / "chair_0001.off"
        path.parent.mkdir(parents=True)
        body = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"
        path.write_text(f"{header}\n{body}")
        mesh = source_of("modelnet", root=str(tmp_path)).load("chair", "chair_0001")
        assert mesh.is_watertight
        assert len(mesh.vertices) == len(mesh.faces) == 4

    def test_missing_folders_are_named(self, tmp_path):
        (tmp_path / "chair").mkdir()
        source = source_of("modelnet", root=str(tmp_path))
        refused(lambda: source.object_ids("chair"), tmp_path / "chair", "train", "test")
        refused(lambda: source.object_ids("car"), tmp_path / "car", "does not exist")


# Real meshes


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


@needs_real
def test_real_toilets_have_their_cisterns_behind():
    source = source_of("folder", root=str(REAL / "meshes"))
    for object_id in source.object_ids("toilet"):
        vertices = np.asarray(source.load("toilet", object_id).vertices)
        top = vertices[vertices[:, 2] > np.quantile(vertices[:, 2], 0.9)]
        assert top[:, 0].mean() < 0
