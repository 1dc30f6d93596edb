"""Numbers, ranges and help texts of the command line."""

import pytest

from commands import OWN, fails, run
from nbv.cli.arguments import as_paragraphs


@pytest.mark.parametrize(
    "rotations",
    [
        ["--rotations", "0", "-90"],
        ["--rotations", "0", "\N{MINUS SIGN}90"],
        ["--rotations=0,\N{EN DASH}90"],
        ["--rotations", "0,-90"],
        ["--rotations=0,-90"],
        ["--rotations", " 0, -90 "],
        ["--rotations", "0", "--rotations", "-90"],
    ],
)
def test_numbers_stand_between_commas_or_spaces(here, capsys, rotations):
    options = ["--bundle", "b.safetensors", "--json"]
    wanted = run(capsys, "recommend", "f0.npy", "f1.npy", *options, "--rotations", "0", "-90")
    assert run(capsys, "recommend", "f0.npy", "f1.npy", *options, *rotations) == wanted
    assert run(capsys, "recommend", *rotations, "f0.npy", "f1.npy", *options) == wanted
    assert run(capsys, "recommend", "f0.npy", *rotations, "f1.npy", *options) == wanted


def test_each_paragraph_of_the_help_is_one_line_before_it_is_wrapped():
    def command(name: str, limit: int = 3) -> None:
        """Do one thing.

        It is a long story, which takes
        two lines.

        Parameters
        ----------
        name
            Of the thing,
            which is known,
            or not.
        limit
            Of names.
        """

    assert as_paragraphs(command) is command
    assert command.__doc__.splitlines() == [
        *("Do one thing.", "", "It is a long story, which takes two lines.", ""),
        *("Parameters", "----------"),
        *("name", "    Of the thing, which is known, or not.", "limit", "    Of names."),
    ]


def test_a_range_allows_every_degree_between_its_ends(table, capsys):
    for given, wanted in (
        (("-60:60",), range(-60, 61)),
        (("-60:-20,", "30:60"), [*range(-60, -19), *range(30, 61)]),
        (("150:210",), range(150, 211)),
        (("-3.5:0",), (-3.5, -2.5, -1.5, -0.5, 0)),
    ):
        for of_what in (("next", "t.npz", "--estimate", "90"), ("recommend", "f0.npy", *OWN)):
            if of_what[0] == "recommend" and len(wanted) == 5:
                continue
            options = (*of_what, "--json", "--allowed")
            assert run(capsys, *options, *given) == run(capsys, *options, *map(str, wanted))
    for given in ("60:-60", "0:361", "5:nan"):
        message = fails(capsys, "next", "t.npz", "--estimate", "90", "--allowed", given)
        assert given in message


def test_angles_beyond_all_turns_are_one_line(table, capsys):
    table = ("next", "t.npz", "--estimate")
    assert "--estimate=1e+300" in fails(capsys, *table, "1e300")
    assert "allowed rotations" in fails(capsys, *table, "3", "--allowed", "1e300")
    frames = ("recommend", "f0.npy", "f1.npy", *OWN, "--rotations", "0", "1e300")
    assert "rotations" in fails(capsys, *frames)
