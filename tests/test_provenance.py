from __future__ import annotations

from pathlib import Path

from nbv import provenance

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src"


def names(script: str, *chosen: str) -> set[str]:
    found = provenance.source_files(ROOT / "workflow/scripts" / script, SOURCE, chosen)
    return {str(Path(path).relative_to(SOURCE / "nbv")) for path in found}


def test_training_depends_on_the_network_and_not_on_rendering_or_criteria():
    found = names("train.py")
    assert {"estimation/networks.py", "estimation/training.py", "errors.py"} <= found
    assert not any(name.startswith(("rendering/", "recommendation/")) for name in found)


def test_only_the_chosen_renderer_counts():
    found = names("render.py", "nbv.rendering.embree:EmbreeRenderer")
    assert "rendering/embree.py" in found
    assert "rendering/pyrender.py" not in found


def test_imports_are_followed_through_modules_and_packages(tmp_path):
    package = tmp_path / "nbv"
    (package / "inner").mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "a.py").write_text("def f():\n    from nbv.inner import b\n")
    (package / "inner" / "__init__.py").write_text("import nbv.c\n")
    (package / "inner" / "b.py").write_text("")
    (package / "c.py").write_text("import json\n")
    (package / "unused.py").write_text("")
    script = tmp_path / "script.py"
    script.write_text("import nbv.a\n")
    found = [Path(p).name for p in provenance.source_files(script, tmp_path)]
    assert found == ["__init__.py", "a.py", "c.py", "__init__.py", "b.py"]


def test_versions_name_every_package_results_depend_on():
    versions = provenance.versions()
    assert set(versions["packages"]) == set(provenance.PACKAGES)
    assert "not installed" not in versions["packages"].values()


def test_outside_a_checkout_the_commit_is_unknown(tmp_path):
    assert provenance.git_commit(tmp_path) == "unknown"
