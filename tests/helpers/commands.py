"""Commands that succeed or fail, and what they print."""

import json

import numpy as np
import pytest

from nbv.cli import main

OWN = ("--bundle", "b.safetensors")


POSE = [[0.0, 0.0, 1.0, -0.6], [-1.0, 0.0, 0.0, 0.1], [0.0, -1.0, 0.0, 0.2], [0.0, 0.0, 0.0, 1.0]]


def run(capsys, *arguments: str) -> str:
    """What a command prints that succeeds."""
    code = main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    assert (code, err) == (0, "")
    return out


def fails(capsys, *arguments: str) -> str:
    """The one line of a command that fails."""
    code = main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    assert code == 2
    assert err.startswith("nbv: error: ")
    if "--json" in arguments:
        assert json.loads(out)["error"]["message"] == err.removeprefix("nbv: error: ").strip()
    else:
        assert out == ""
    assert err.endswith("\n")
    assert err.count("\n") == 1
    return err.strip()


def same_answer(printed: dict, answer) -> None:
    assert printed["probability_within"] == pytest.approx(answer.probability_within, rel=1e-4)
    assert printed["azimuth_deg"] == pytest.approx(answer.azimuth_deg)
    assert printed["spread_deg"] == pytest.approx(answer.spread_deg)
    assert printed["expected_error_deg"] == pytest.approx(answer.expected_error_deg, rel=1e-4)
    assert printed["belief"] == pytest.approx(answer.belief.tolist(), abs=1e-5)
    assert printed["ood_score"] == pytest.approx(answer.ood_score, rel=1e-4)
    same_move(printed, answer)


def same_move(printed: dict, answer) -> None:
    moves = answer.moves
    for one, move in zip([printed["move"], *printed["alternatives"]], moves, strict=True):
        assert one["rotation_deg"] == move.rotation_deg
        assert one["travel_deg"] == move.travel_deg
        assert one["expected_error_deg"] == pytest.approx(move.expected_error_deg, rel=1e-4)
        assert one["probability_within"] == pytest.approx(move.probability_within, rel=1e-4)
    known = [np.inf if error is None else error for error in printed["error_after_deg"]]
    assert known == pytest.approx(answer.error_after_deg.tolist(), rel=1e-4)
