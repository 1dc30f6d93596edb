"""What a person who made a mistake reads: one clear line, before anything is spent."""

import pytest
import trimesh

from projects import TINY

pytestmark = pytest.mark.slow


def test_a_wrong_setting_is_one_line_and_writes_nothing(fresh):
    before = sorted(fresh.folder.rglob("*"))
    done = fresh.run("--cores", "1", overrides=(*TINY, "estimator.epocs=3"), fails=True)
    assert "did you mean 'estimator.epochs'?" in done.stderr
    assert "Traceback" not in done.stderr
    assert "Error in" not in done.stderr
    assert sum(line.startswith("nbv: error: ") for line in done.stderr.splitlines()) == 1
    written = set(fresh.folder.rglob("*")) - set(before)
    assert {path.relative_to(fresh.folder).parts[0] for path in written} <= {".snakemake", "src"}


@pytest.mark.parametrize("name", ["depth/mug/el33.npy", "estimates/mug/el00/fold9/test.csv"])
def test_a_fold_or_an_elevation_that_does_not_exist_is_one_line(fresh, name):
    done = fresh.run("--cores", "1", "--dry-run", f"results/tiny/{name}", fails=True)
    line = done.stderr.splitlines()[-1]
    assert line.startswith(f"nbv: error: results/tiny/{name} is not of this run")
    assert line.endswith("which has mug/el00, chair/el00, each with fold1 to fold2")


def test_a_bad_mesh_stops_the_run_before_anything_is_rendered(fresh, monkeypatch):
    """The settings of a user's environment do not matter."""
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    monkeypatch.setenv("HOME", "/dev/null")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    folder = fresh.folder / "things/mug"
    folder.mkdir(parents=True)
    for index in range(5):
        trimesh.creation.box((1, 2, 3 + index)).export(folder / f"{index}.ply")
    (folder / "bad.obj").write_text("v 0 0 0\nv nan 1 0\nv 0 1 1\nf 1 2 3\n")
    own = ("dataset=folder", "dataset.root=things", "categories=[mug]", "n_objects=null")
    done = fresh.run("--cores", "2", overrides=(*TINY, *own), fails=True)
    last_words = done.stderr.split("nbv: stopped")[1]
    assert "things/mug/bad.obj" in last_words
    assert "vertex 1 is not finite" in last_words
    assert "Traceback" not in done.stderr
    assert not (fresh.results / "depth").exists()


def test_a_file_where_the_results_should_be_is_one_line(fresh):
    fresh.results.parent.write_text("")
    done = fresh.run("--cores", "1", fails=True)
    assert "nbv: error: results is not a folder" in done.stderr
    assert "Traceback" not in done.stderr
