import json

import numpy as np
import pytest
from performance.__main__ import BENCHMARKS, main
from performance.figures import Figure, Target, summary_line, table_line
from performance.timing import Times, median_ratio, take_turns


def test_a_quick_run_writes_a_list_of_figures(tmp_path, capsys):
    path = tmp_path / "bench.json"
    main(["--quick", "--only", "lookup", "--output", str(path)])
    figures = json.loads(path.read_text())
    (figure,) = figures
    assert list(figure) == sorted(["name", "ratio", "target", "reached", "detail"])
    assert figure["ratio"] > 0
    assert isinstance(figure["reached"], bool)
    assert figure["name"] in capsys.readouterr().out


def test_a_part_does_not_take_the_place_of_the_whole(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    main(["--quick", "--only", "lookup"])
    assert [path.name for path in tmp_path.rglob("*.json")] == ["bench-partial.json"]


def test_an_unknown_name_is_refused_with_those_there_are(capsys):
    with pytest.raises(SystemExit):
        main(["--only", "rendring"])
    message = capsys.readouterr().err
    assert all(name in message for name in BENCHMARKS)


def test_the_ratio_is_the_median_of_neighbours_not_the_ratio_of_medians():
    # The machine was ten times slower in the second and third round, for both alike.
    times = Times(np.array([[2.0, 1.0], [20.0, 10.0], [20.0, 10.0], [2.0, 1.0], [9.0, 1.0]]))
    assert times.ratio(0, 1) == 2.0
    assert median_ratio([2, 20, 9], [1, 10, 1]) == 2.0


def test_works_take_turns():
    calls = []
    times = take_turns([lambda: calls.append("a"), lambda: calls.append("b")], 3)
    assert "".join(calls) == "ab" * 4
    assert times.rounds.shape == (3, 2)
    assert (times.rounds > 0).all()
    calls.clear()
    take_turns([lambda: calls.append("a"), lambda: calls.append("b")], 2, False, in_a_row=3)
    assert "".join(calls) == "aaabbb" * 2


@pytest.mark.parametrize(
    ("target", "ratio", "reached"),
    [
        (Target(0.9), 0.9, True),
        (Target(0.9), 0.89, False),
        (Target(1.3, at_most=True), 1.3, True),
        (Target(1.3, at_most=True), 1.31, False),
        (Target(3.0), None, None),
    ],
)
def test_targets_hold_from_their_own_side(target, ratio, reached):
    figure = Figure("what", ratio, target, "how")
    assert figure.reached is reached
    assert ("MISSED" in table_line(figure)) is (reached is False)


def test_what_was_not_measured_counts_neither_way():
    figures = [
        Figure("a", 5.0, Target(3), ""),
        Figure("b", 1.0, Target(3), ""),
        Figure("c", None, Target(3), "skipped"),
    ]
    assert summary_line(figures) == "1 of 2 targets reached"
