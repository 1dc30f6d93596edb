"""Which file tests a module: the one of its name, in the folder of its subpackage."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
# What tests no single module.
APART = {"browser", "faults", "fuzz", "kept", "pages", "performance", "repository", "website"}
APART |= {"helpers", "workflow"}


def test_every_file_of_unit_tests_has_the_name_of_a_module_of_its_room():
    for path in ROOT.glob("tests/**/test_*.py"):
        place = path.relative_to(ROOT / "tests")
        if place.parts[0] in APART:
            continue
        source = ROOT if place.parts[0] == "studies" else ROOT / "src/nbv"
        name = place.stem.removeprefix("test_")
        module = source / place.parent / name
        is_package = module.is_dir() or name == place.parent.name
        assert is_package or module.with_suffix(".py").is_file(), path
