import os
import subprocess
import sys

DRAW = """
import sys
from pathlib import Path
import matplotlib as mpl
from nbv.style import RC, new_figure, save_figure
with mpl.rc_context(RC):
    figure = new_figure(3.0, 2.0)
    figure.subplots().plot([0, 1], [0, 1], label="x")
    figure.legend()
save_figure(figure, {kind: Path(sys.argv[1], f"one.{kind}") for kind in ("png", "pdf", "svg")})
"""
HOSTILE = """
font.size: 40
lines.linewidth: 9
axes.facecolor: red
savefig.bbox: tight
savefig.dpi: 17
svg.fonttype: path
axes.labelpad: 50
text.usetex: True
"""


def drawn(folder, **environment: str) -> list[bytes]:
    folder.mkdir()
    subprocess.run(
        [sys.executable, "-c", DRAW, str(folder)],
        check=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)} | environment,
    )
    return [(folder / f"one.{kind}").read_bytes() for kind in ("png", "pdf", "svg")]


def test_neither_a_users_matplotlibrc_nor_a_backend_changes_a_byte(tmp_path):
    settings = tmp_path / "matplotlibrc"
    settings.write_text(HOSTILE)
    plain = drawn(tmp_path / "plain")
    hostile = drawn(
        tmp_path / "hostile", MATPLOTLIBRC=str(settings), MPLBACKEND="module://nonexistent"
    )
    assert plain == hostile
