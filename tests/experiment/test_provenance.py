from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

from omegaconf import OmegaConf

import nbv
from nbv.data.render import RENDERERS
from nbv.data.sources import SOURCES
from nbv.experiment import provenance

ROOT = Path(__file__).parents[2]


def names(script: str, *chosen: str) -> set[str]:
    (path,) = (ROOT / "workflow/scripts").glob(script)
    package = Path(nbv.__file__).parent
    return {str(Path(p).relative_to(package)) for p in provenance.source_files(path, chosen)}


def test_training_depends_on_the_network_and_not_on_rendering_or_criteria():
    found = names("train_estimator.py")
    assert {"estimation/networks.py", "estimation/training.py", "errors.py"} <= found
    assert not any(name.startswith(("rendering/", "recommendation/")) for name in found)


def test_an_edit_of_the_configuration_package_trains_nothing_again():
    for script in ("train_estimator.py", "pretrain_network.py", "train_bundle.py"):
        assert not [name for name in names(script) if name.startswith("config/")]


def test_what_reads_another_programs_pairs_trains_nothing_again():
    readers = {"calibration/pairs.py", "calibration/distributions.py"}
    assert readers <= names("take_estimates.py")
    assert not readers & (names("train_estimator.py") | names("estimate_views.py"))


def test_only_the_chosen_renderer_counts():
    found = names("render_depth.py", RENDERERS["embree"])
    assert "rendering/embree.py" in found
    assert "rendering/pyrender.py" not in found


def test_an_import_within_a_function_counts():
    generators = "meshes/procedural/__init__.py"
    assert generators in names("*meshes.py", SOURCES["procedural"])
    assert generators not in names("*meshes.py", SOURCES["folder"])


def test_an_edit_of_the_schema_does_not_rerun_the_splits():
    found = names("split_objects.py")
    assert "fold_sizes.py" in found
    assert not any(name.startswith("config") for name in found)


def test_a_page_depends_on_its_templates_and_on_no_other_page():
    report, explorer, table = (
        {name.rpartition("/")[2] for name in names(script) if "/templates/" in name}
        for script in ("build_report.py", "build_explorer.py", "tabulate_paper.py")
    )
    assert {"report.html.j2", "report.css"} <= report
    assert {"explorer.html.j2", "explorer.css", "explorer_drawing.js"} <= explorer
    assert {"table.html.j2", "table.md.j2", "table.tex.j2"} <= table
    everything = {path.name for path in Path(nbv.__file__).parent.glob("**/templates/*")}
    assert report | explorer | table == everything
    assert not report & explorer


def test_imports_are_followed_to_their_end_and_with_packages(tmp_path):
    """The files are those that a fresh Python loads, for modules that import nothing later."""
    script = tmp_path / "script.py"
    script.write_text("with open(__file__):\n    from nbv.experiment.splits import make_splits\n")
    program = (
        f"import runpy, sys; runpy.run_path({str(script)!r})\n"
        "print(*sorted(m.__file__ for n, m in sys.modules.items() if n.split('.')[0] == 'nbv'))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert provenance.source_files(script) == done.stdout.split()


def test_versions_name_every_package_results_depend_on():
    versions = provenance.versions()
    assert set(versions["packages"]) == set(provenance.PACKAGES)
    assert "not installed" not in versions["packages"].values()


def test_outside_a_checkout_the_commit_is_unknown(tmp_path):
    assert provenance.git_commit(tmp_path) == "unknown"


def test_the_version_stands_in_the_package_alone_and_the_citation_agrees():
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "version" not in pyproject["project"]
    assert pyproject["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "nbv.__version__"}
    assert OmegaConf.load(ROOT / "CITATION.cff").version == nbv.__version__
