"""The runner: ``python -m performance [--quick] [--only NAME]``."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from nbv.files import write_json
from performance.figures import HEADER, Figure, summary_line, table_line

# In the order of the table; each is a module with `run(quick) -> list[Figure]`.
BENCHMARKS = ("rendering", "training", "lookup", "frames")


def main(arguments: Sequence[str] | None = None) -> list[Figure]:
    """Run benchmarks, print their figures as they come, and write them to a JSON file."""
    options = _parser().parse_args(arguments)
    names = options.only or BENCHMARKS
    started = time.perf_counter()
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    print(f"{os.cpu_count()} cores{load}; each figure is a median of ratios of neighbours in time")
    print(HEADER, flush=True)
    figures: list[Figure] = []
    for name in names:
        for figure in import_module(f"performance.{name}").run(options.quick):
            figures.append(figure)
            print(table_line(figure), flush=True)
    whole = not options.quick and set(names) == set(BENCHMARKS)
    path = options.output or Path("results", "bench.json" if whole else "bench-partial.json")
    write_json(path, [figure.as_json() for figure in figures])
    if options.quick:
        print("quick: too small for the targets, which are for the whole form")
    print(f"{summary_line(figures)}; {time.perf_counter() - started:.0f} s; written to {path}")
    return figures


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m performance", description=__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="small sizes, few repetitions: to see that it runs"
    )
    parser.add_argument(
        "--only", action="append", choices=BENCHMARKS, metavar="NAME", help=", ".join(BENCHMARKS)
    )
    parser.add_argument(
        "--output",
        type=Path,
        help="default: results/bench.json, or bench-partial.json with --quick or --only",
    )
    return parser


if __name__ == "__main__":
    main()
    sys.exit(0)
