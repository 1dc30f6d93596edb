"""Opening a source by name, and selecting objects."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter

import trimesh

from mesh_files import CONFIG, put, refused, settings_of, source_of
from nbv.data.sources import SOURCES, open_source, select_objects
from nbv.data.sources.files import EXTENSIONS


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
