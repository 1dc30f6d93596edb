"""Opening a source by name, and selecting objects."""

import itertools
import logging
import subprocess
import sys
import time
from collections import Counter

import numpy as np
import pytest
import trimesh

from mesh_files import CONFIG, put, refused, settings_of, source_of
from nbv.data.copies import find_copies
from nbv.data.meshes import as_mesh
from nbv.data.sources import SOURCES, open_source, prepare_meshes, select_objects
from nbv.data.sources.files import EXTENSIONS
from nbv.errors import UserError


def test_every_source_has_its_configuration_and_opens():
    assert {path.stem for path in CONFIG.glob("*.yaml")} == set(SOURCES)
    fields = set(settings_of("procedural"))
    for name in SOURCES:
        settings = settings_of(name, root="anywhere")
        # What only generated objects have.
        own = set() if name == "procedural" else {"handle_reach", "square_share"}
        assert set(settings) == fields - own
        assert open_source(settings, seed=3).name == settings["source"] == name
        assert open_source(settings, seed=3).seed == 3


def test_configurations_have_the_keys_of_the_schema():
    from nbv.experiment.config.schema import Dataset

    assert list(settings_of("procedural")) == list(Dataset.model_fields)


def test_an_unknown_source_is_named_with_the_nearest():
    settings = settings_of("folder", source="foldr")
    refused(lambda: open_source(settings, 0), "dataset.source=foldr", "did you mean 'folder'")


def test_listing_imports_no_mesh_library(tmp_path):
    put(tmp_path / "mug" / "a.ply")
    settings = settings_of("folder", root=str(tmp_path))
    program = (
        "import sys; from nbv.data.sources import open_source, select_objects\n"
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
        assert "n_objects=3" not in message  # which may be too few for the folds
        assert all(extension in message for extension in EXTENSIONS)

    def test_no_mesh_at_all_is_not_a_number_to_set(self, tmp_path):
        (tmp_path / "mug").mkdir()
        for n_objects in (125, None):
            message = refused(lambda n=n_objects: self.ids(tmp_path, n, n_files=0), "no usable")
            assert "n_objects" not in message


@pytest.fixture
def root(tmp_path):
    for i in range(12):
        put(tmp_path / "mug" / f"m{i:02d}.ply", trimesh.creation.box((1, 1 + i / 12, 1)))
    return tmp_path


def test_meshes_come_in_the_order_asked_for(root):
    source = source_of("folder", root=str(root))
    ids = source.object_ids("mug")[::-1]
    prepared = prepare_meshes(source, "mug", ids)
    assert list(prepared) == ids
    assert np.array_equal(prepared["m04"].faces, source.load("mug", "m04").faces)


def test_every_bad_file_is_logged_and_the_first_is_raised(root, caplog):
    bad = [root / "mug" / f"m{i:02d}.ply" for i in (3, 7, 8)]
    for path in bad:
        path.write_bytes(b"")
    source = source_of("folder", root=str(root))
    with pytest.raises(UserError, match=r"and 2 more, logged above.*dataset.exclude") as caught:
        prepare_meshes(source, "mug", source.object_ids("mug"))
    assert str(caught.value).startswith(str(bad[0]))
    assert "\n" not in str(caught.value)
    errors = [record.message for record in caplog.records if record.levelno == logging.ERROR]
    assert [line.startswith(str(path)) for line, path in zip(errors, bad, strict=True)] == [
        True
    ] * 3


def test_progress_is_logged(root, caplog, monkeypatch):
    monkeypatch.setattr(time, "monotonic", itertools.count(step=10.0).__next__)
    source = source_of("folder", root=str(root))
    with caplog.at_level(logging.INFO, logger="nbv"):
        prepare_meshes(source, "mug", source.object_ids("mug"))
    assert "mug meshes: 3 of 12, 90 s left" in caplog.text
    assert "mug meshes: 12 in 130.0 s" in caplog.text


def finer(mesh, rng):
    """The same surface in smaller triangles, with vertices and faces in another order."""
    fine = mesh.subdivide()
    order = rng.permutation(len(fine.vertices))
    faces = rng.permutation(np.argsort(order)[fine.faces])
    return trimesh.Trimesh(fine.vertices[order], faces, process=False)


def test_copies_are_named_with_what_leaves_them_out(root):
    rng = np.random.default_rng(0)
    ring = trimesh.creation.torus(1.0, 0.3)
    for name, mesh in {
        "a": ring,
        "b": finer(ring, rng).apply_scale(3.0),
        "c": trimesh.creation.torus(1.0, 0.33),
        "d": finer(ring, rng),
    }.items():
        put(root / "mug" / f"{name}.ply", mesh)
    source = source_of("folder", root=str(root))
    with pytest.raises(UserError, match=r"mug: b is a copy of a, d is a copy of a;") as caught:
        prepare_meshes(source, "mug", source.object_ids("mug"))
    assert str(caught.value).endswith("dataset.exclude=[b,d]")


def test_no_surface_is_taken_for_another_of_the_same_size():
    """A box with a hole has the extents of the box without it."""
    box = trimesh.creation.box((1, 2, 1.5))
    frame = trimesh.util.concatenate(
        [
            trimesh.creation.box((1, 2, 0.4), trimesh.transformations.translation_matrix((0, 0, z)))
            for z in (-0.55, 0.55)
        ]
    )
    meshes = {name: as_mesh(mesh) for name, mesh in {"box": box, "frame": frame}.items()}
    assert find_copies(meshes) == {}
    assert find_copies(meshes | {"again": meshes["frame"]}) == {"again": "frame"}
