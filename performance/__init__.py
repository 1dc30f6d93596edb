"""What is claimed about speed, as ratios taken on the spot: ``python -m performance --help``.

Each module holds one benchmark, ``run(quick) -> list[Figure]``. Absolute seconds say more about a
machine and its other work than about a program, so every figure is a ratio of two things that took
turns in the same run.
"""

from __future__ import annotations

import os

# Numerical libraries read these once, when they are first imported.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"
