"""The time that a run still takes: exact where its jobs take what is expected of them."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.progress.estimate import START_S, Job, Seen, estimate, with_reference


@st.composite
def workflows(draw):
    """Jobs that wait for earlier ones only, each with the seconds that it takes."""
    # Sums of 64ths are exact: which of two jobs ends first is then no matter of rounding.
    seconds_of = st.integers(6, 3200).map(lambda number: number / 64)
    kinds = draw(st.dictionaries(st.sampled_from("abc"), seconds_of, min_size=1))
    jobs = {}
    # Each its own, and so is the order in which they start.
    priorities = draw(st.permutations(range(12)))
    for number in range(draw(st.integers(1, 12))):
        kind = draw(st.sampled_from(sorted(kinds)))
        size = draw(st.sampled_from([1.0, 2.0, 5.0]))
        needs = draw(st.frozensets(st.integers(0, number - 1), max_size=3)) if number else ()
        seconds = START_S + kinds[kind] * size
        jobs[number] = Job(kind, size, frozenset(needs), priorities[number], seconds)
    return jobs


def run(jobs, cores):
    """Return when each job starts and ends, by looking at every moment at which one ends."""
    starts, ends, now = {}, {}, 0.0
    while len(starts) < len(jobs):
        ended = {number for number, end in ends.items() if end <= now}
        free = cores - (len(starts) - len(ended))
        could = [n for n, job in jobs.items() if n not in starts and job.needs <= ended]
        could.sort(key=lambda n: -jobs[n].priority)
        for number in could[:free]:
            starts[number], ends[number] = now, now + jobs[number].reference_s
        now = min((end for end in ends.values() if end > now), default=now)
    return starts, ends


def seen_at(now, starts, ends):
    order = sorted(ends, key=ends.get)
    return Seen(
        finished={n: ends[n] - starts[n] for n in order if ends[n] <= now},
        running={n: now - starts[n] for n in order if starts[n] <= now < ends[n]},
    )


@given(workflows(), st.integers(1, 4))
def test_a_run_that_goes_as_expected_ends_when_it_was_said_to_at_every_moment(jobs, cores):
    starts, ends = run(jobs, cores)
    end = max(ends.values())
    for before, after in pairwise(sorted({0.0, *ends.values()})):
        for now in (before, (before + after) / 2):
            found = estimate(jobs, seen_at(now, starts, ends), cores)
            assert found.left_s == pytest.approx(end - now, abs=1e-6)


@given(workflows(), st.integers(1, 4))
def test_the_share_that_is_done_grows_from_nothing_to_all(jobs, cores):
    starts, ends = run(jobs, cores)
    moments = sorted({0.0, *starts.values(), *ends.values()})
    done = [estimate(jobs, seen_at(now, starts, ends), cores).done for now in moments]
    assert (done[0], done[-1]) == (0, 1)
    assert all(after > before for before, after in pairwise(done))
    assert estimate(jobs, seen_at(moments[-1], starts, ends), cores).left_s == 0


@given(workflows(), st.integers(1, 4))
def test_no_schedule_beats_the_work_or_the_longest_chain_and_none_is_as_long_as_both(jobs, cores):
    chain = {}
    for number, job in jobs.items():
        chain[number] = job.reference_s + max((chain[need] for need in job.needs), default=0)
    share, longest = sum(job.reference_s for job in jobs.values()) / cores, max(chain.values())
    found = estimate(jobs, Seen(), cores).left_s
    assert max(share, longest) <= found * (1 + 1e-9)
    assert found <= (share + longest) * (1 + 1e-9)


@pytest.mark.parametrize(("n_jobs", "cores"), [(8, 1), (8, 2), (9, 2), (3, 8)])
def test_equal_jobs_take_turns_on_the_cores(n_jobs, cores):
    jobs = {number: Job("train") for number in range(n_jobs + 1)}
    found = estimate(jobs, Seen(finished={0: 60.0}), cores)
    assert found.left_s == pytest.approx(60 * math.ceil(n_jobs / cores))
    assert found.done == pytest.approx(1 / (n_jobs + 1))
    assert found.basis == "this run"


def test_a_job_of_twice_the_size_takes_twice_as_long_beyond_its_start():
    jobs = {0: Job("train", 10), 1: Job("train", 20)}
    found = estimate(jobs, Seen(finished={0: START_S + 30}), 1)
    assert found.left_s == pytest.approx(START_S + 60)


def test_times_of_this_run_outweigh_those_of_the_reference():
    jobs = {number: Job("train", reference_s=300) for number in range(4)}
    assert estimate(jobs, Seen(), 1).left_s == 1200
    assert estimate(jobs, Seen(), 1).basis == "reference"
    measured = estimate(jobs, Seen(finished={0: 75}), 1)
    assert (measured.left_s, measured.basis) == (pytest.approx(225), "this run")


def test_on_a_machine_of_half_the_speed_unknown_jobs_take_twice_the_reference_time():
    jobs = {
        0: Job("render", reference_s=10),
        1: Job("splits", reference_s=4),
        # Faster than all the rest, as trainings are where bfloat16 is native.
        2: Job("train", reference_s=300),
        3: Job("lookup", reference_s=5),
    }
    found = estimate(jobs, Seen(finished={0: 20, 1: 8, 2: 75}), 1)
    assert found.left_s == pytest.approx(10)


def test_a_running_job_that_says_how_long_it_takes_is_believed_and_so_for_its_kind():
    jobs = {number: Job("train", reference_s=300) for number in range(2)}
    found = estimate(jobs, Seen(running={0: 20}, said_left={0: 60}), 1)
    assert found.left_s == pytest.approx(60 + 80)


def test_the_last_jobs_count_most():
    jobs = {number: Job("train") for number in range(21)}
    slower = {number: 10.0 if number < 10 else 20.0 for number in range(20)}
    found = estimate(jobs, Seen(finished=slower), 1).left_s
    assert 18 < found < 20


def test_an_unknown_job_is_like_the_median_of_the_others():
    jobs = {number: Job("known", reference_s=seconds) for number, seconds in enumerate((1, 2, 99))}
    jobs[3] = Job("unknown")
    assert estimate(jobs, Seen(), 1).left_s == 1 + 2 + 99 + 2
    assert estimate({0: Job("unknown")}, Seen(), 1).basis == "guess"


def test_a_job_that_takes_longer_than_expected_is_not_done():
    jobs = {0: Job("train", reference_s=10)}
    found = estimate(jobs, Seen(running={0: 25}), 2)
    assert found.left_s > 0
    assert found.done < 1


def test_what_waits_for_a_failed_job_is_not_waited_for():
    jobs = {
        0: Job("train", reference_s=10),
        1: Job("estimate", needs=frozenset({0}), reference_s=20),
        2: Job("train", reference_s=7),
    }
    found = estimate(jobs, Seen(failed={0}), 2)
    assert found.left_s == 7
    assert found.done == 0


def test_a_finished_job_that_nobody_timed_is_done():
    jobs = {0: Job("train", reference_s=10), 1: Job("train", reference_s=30)}
    found = estimate(jobs, Seen(finished={0: None}), 1)
    assert (found.done, found.left_s) == (0.25, 30)


@given(st.lists(st.integers(1, 100), min_size=1, max_size=8), st.floats(1, 500))
def test_the_reference_gives_a_job_of_mean_size_its_mean_time(sizes, mean_s):
    jobs = {number: Job("train", size) for number, size in enumerate(sizes)}
    whole = with_reference(jobs, {"train": mean_s}, {})
    assert sum(job.reference_s for job in whole.values()) == pytest.approx(mean_s * len(sizes))
    apart = with_reference(jobs, {"train": mean_s}, {"train": 10.0})
    assert apart[0].reference_s == pytest.approx(START_S + (mean_s - START_S) * sizes[0] / 10)
    assert with_reference(jobs, {}, {})[0].reference_s is None
