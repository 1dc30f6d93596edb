import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from omegaconf import OmegaConf

import nbv
from nbv.data.render import RENDERERS
from nbv.data.sources import SOURCES
from nbv.experiment.run import provenance

ROOT = Path(__file__).parents[3]


ROOMS = ("frames", "choice", "bundles", "tables", "cli", "experiment/config")
TRAININGS = ("train_estimator", "pretrain_network", "train_bundle")
STUDIES = sorted(path.stem for path in ROOT.glob("studies/scripts/*.py"))


def names(script: str, *chosen: str) -> set[str]:
    (path,) = ROOT.glob(f"*/scripts/{script}.py")
    package = Path(nbv.__file__).parent
    files = map(Path, provenance.source_files(path, chosen))
    return {
        str(file.relative_to(package if file.is_relative_to(package) else ROOT)) for file in files
    }


@pytest.mark.parametrize("script", TRAININGS)
def test_a_training_depends_on_networks_and_little_else(script):
    """What is worked on later must train nothing again: fusion, criteria, lookups, settings."""
    found = names(script)
    assert {"experiment/estimation/networks.py", "experiment/estimation/training.py"} <= found
    assert len(found) <= 15
    needed = {*(f"core/circle/{n}.py" for n in ("angles", "estimates", "logits")), "core/seeds.py"}
    assert {name for name in found if name.startswith("core/")} <= needed
    assert {name for name in found if name.startswith("data/")} <= {
        *("data/depth_images.py", "data/progress.py")
    }
    assert not [name for name in found if name.startswith(tuple(f"{room}/" for room in ROOMS))]


@pytest.mark.parametrize("script", ["render_depth", "split_objects", "prepare_meshes"])
def test_an_edit_of_the_configuration_package_makes_no_images_or_folds_again(script):
    found = names(script, SOURCES["procedural"], RENDERERS["embree"])
    assert not [name for name in found if name.startswith("experiment/config/")]


@pytest.mark.parametrize("script", ["train_estimator", "build_lookup", "tabulate_paper"])
def test_the_paper_depends_on_no_study(script):
    assert not [name for name in names(script) if name.startswith("studies/")]


@pytest.mark.parametrize("script", STUDIES)
def test_a_study_depends_on_its_own_modules_and_on_no_plan(script):
    found = names(script)
    assert [name for name in found if name.startswith("studies/")]
    assert not {"studies/plan.py", "experiment/plan.py", "experiment/run/jobs.py"} & found


def test_what_reads_another_programs_pairs_trains_nothing_again():
    assert "tables/pairs.py" in names("take_estimates")
    assert "tables/pairs.py" not in names("train_estimator") | names("estimate_views")


def test_only_the_chosen_renderer_counts():
    found = names("render_depth", RENDERERS["embree"])
    assert "data/embree.py" in found
    assert "data/pyrender.py" not in found


def test_an_import_within_a_function_counts():
    generators = "data/procedural/__init__.py"
    assert generators in names("prepare_meshes", SOURCES["procedural"])
    assert generators not in names("prepare_meshes", SOURCES["folder"])


def test_a_page_depends_on_its_templates_and_on_no_other_page():
    report, explorer, table = (
        {name.rpartition("/")[2] for name in names(script) if "/templates/" in name}
        for script in ("build_report", "build_explorer", "tabulate_paper")
    )
    assert {"page.html.j2", "page.css"} <= report
    assert {"explorer.html.j2", "explorer.css", "explorer_drawing.js"} <= explorer
    assert {"table.html.j2", "table.md.j2", "table.tex.j2"} <= table
    everything = {path.name for path in Path(nbv.__file__).parent.glob("**/templates/*")}
    assert report | explorer | table == everything
    assert report & explorer <= table


def test_a_table_depends_on_the_published_numbers():
    assert {f"experiment/paper/published{end}" for end in (".csv", "_notes.csv", ".py")} <= set(
        names("tabulate_paper")
    )
    assert "experiment/paper/published.csv" not in names("render_depth")


def test_imports_are_followed_to_their_end(tmp_path):
    """The files are those that a fresh Python loads, where nothing is imported from a package."""
    script = tmp_path / "script.py"
    script.write_text("with open(__file__):\n    from nbv.experiment.splits import make_splits\n")
    program = (
        f"import runpy, sys; runpy.run_path({str(script)!r})\n"
        "print(*sorted(m.__file__ for n, m in sys.modules.items() if n.split('.')[0] == 'nbv'))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    loaded = [path for path in done.stdout.split() if not path.endswith("__init__.py")]
    assert provenance.source_files(script) == loaded


def test_versions_name_every_package_results_depend_on():
    versions = provenance.versions()
    assert set(versions["packages"]) == set(provenance.PACKAGES)
    assert "not installed" not in versions["packages"].values()


def test_outside_a_checkout_the_commit_is_unknown(tmp_path):
    assert provenance.git_commit(tmp_path) == "unknown"


@pytest.mark.skipif(shutil.which("git") is None, reason="no git here")
def test_the_checkout_of_another_user_is_told_with_the_remedy(tmp_path, monkeypatch, caplog):
    subprocess.run(["git", "init", "--quiet", tmp_path], check=True)
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", "1")
    assert provenance.git_commit(tmp_path) == "unknown"
    assert f"safe.directory {tmp_path}" in caplog.text


def test_the_version_stands_in_the_package_alone_and_the_citation_agrees():
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "version" not in pyproject["project"]
    assert pyproject["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "nbv.__version__"}
    assert OmegaConf.load(ROOT / "CITATION.cff").version == nbv.__version__
