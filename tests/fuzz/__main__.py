"""The long run of fuzzing, or one case again: ``python -m tests.fuzz --help``."""

import argparse
import sys
import tempfile
import time
from pathlib import Path

from tests.fuzz.campaign import Campaign, Case, cases, table


def say(*lines: object) -> None:
    sys.stdout.write("".join(f"{line}\n" for line in lines))
    sys.stdout.flush()


def main() -> int:
    parser = argparse.ArgumentParser(description="Read damaged files of every kind.")
    parser.add_argument("--cases", type=int, default=2000, help="at least this many")
    parser.add_argument("--minutes", type=float, default=30.0, help="no new cases after that")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--replay", metavar="KIND:NUMBER", help="one case of that seed again")
    given = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="nbv-fuzz-"))
    campaign = Campaign(folder, given.seed, given.workers)
    if given.replay:
        kind, _, number = given.replay.rpartition(":")
        done = list(campaign.run([Case(kind, int(number))]))
        say(*done[0])
        return int(done[0].outcome == "failed")
    start, done, failures = time.monotonic(), [], []
    for outcome in campaign.run(cases(given.cases), start + 60 * given.minutes):
        done.append(outcome)
        failures += [outcome] if outcome.outcome == "failed" else []
        if len(done) % 100 == 0:
            minutes = (time.monotonic() - start) / 60
            say(f"{len(done)} cases, {len(failures)} failures, {minutes:.1f} minutes")
    for outcome in failures:
        say(f"{outcome.case.reader}:{outcome.case.number} {outcome.detail[:200]!a}")
    say(table(done), f"seed {given.seed}; the files of failures: {folder / 'failed'}")
    return int(bool(failures) or len(done) < given.cases)


if __name__ == "__main__":
    sys.exit(main())
