# How far a run is, in one line, in place of Snakemake's own messages.

import os

from snakemake.logging import logger
from snakemake.settings.enums import Quietness

from nbv.experiment.config import read_configuration
from nbv.experiment.jobs import is_verbose
from nbv.progress.chatter import WithoutChatter
from nbv.progress.estimate import Job, with_reference
from nbv.progress.line import Line
from nbv.progress.run import Planned, RunProgress
from nbv.experiment.report.runtime import load_measured

try:
    VERBOSE = is_verbose(config)
except UserError as error:
    stop(error)

# Other messages would break a line that is written in place.
PROGRESS_LINE = Line(
    sys.stderr,
    in_place=sys.stderr.isatty() and os.environ.get("TERM") != "dumb" and not VERBOSE,
)
# None where the user chose a logger plugin, which shows what it wants.
TERMINAL_HANDLER = next(
    (each for each in logger.handlers if each.name == "DefaultStreamHandler"), None
)


def choose_messages():
    """Show what the user has to know of Snakemake's messages, or with verbose=true all of them."""
    if TERMINAL_HANDLER is None or not workflow.is_main_process:
        return
    if VERBOSE:
        for part in (*TERMINAL_HANDLER.filters, TERMINAL_HANDLER.formatter):
            part.quiet = set()
    elif not workflow.output_settings.verbose:
        TERMINAL_HANDLER.addFilter(
            WithoutChatter(
                is_running=lambda: workflow.executor_plugin and not workflow.dryrun,
                make_room=PROGRESS_LINE.clear,
            )
        )


choose_messages()


# What is estimated, and from what.


def kind_of(rule):
    return Path(rule.script).stem


def size_of(job):
    """What a job's time is in proportion to, among jobs of the same script."""
    objects = len(OBJECTS.get(job.wildcards.get("category"), ()))
    return (objects or len(job.input)) * job.params.get("estimator", {}).get(
        "epochs", 1
    )


def reference_means():
    """Seconds and size of the reference run's jobs, by kind: its first guess of this run's."""
    reference = REFERENCES / "paper"
    if not (reference / "runtime.csv").is_file():
        return {}, {}
    known = read_configuration(reference, ("categories", "elevations_deg", "estimator"))
    stages = [
        stage_from(start_of(known["estimator"]["warm_start"], elevations, elevation))
        for elevations in map(known["elevations_deg"].get, known["categories"])
        for elevation in elevations
    ]
    epochs = [stage_settings(known["estimator"], stage)["epochs"] for stage in stages]
    seconds, sizes = {}, {}
    named = {rule.name: rule for rule in workflow.rules if rule.script}
    for name, (n_jobs, wall_s) in load_measured(reference / "runtime.csv").items():
        if name not in named:
            continue
        kind = kind_of(named[name])
        seconds[kind] = wall_s / n_jobs
        if "category" in named[name].wildcard_names:
            trains = kind == "train_estimator"
            sizes[kind] = known["n_objects"] * (
                sum(epochs) / len(epochs) if trains else 1
            )
    return seconds, sizes


def planned_jobs():
    """Every job of this run by its number, with those that need not run again."""
    dag = workflow.dag
    needed = set(dag.needrun_jobs())
    # Snakemake numbers what it runs, from 0.
    numbers = {
        job: dag.jobid(job) if job in needed else -index
        for index, job in enumerate(dag.jobs, 1)
        if job.rule.script
    }
    jobs = {
        numbers[job]: Job(
            kind=kind_of(job.rule),
            size=size_of(job),
            needs=frozenset(
                numbers[other] for other in dag.dependencies[job] if other in numbers
            ),
            # Snakemake gives none to some jobs that need not run.
            priority=job.priority if job in needed else 0,
        )
        for job in numbers
    }
    timed = with_reference(jobs, *reference_means())
    return {
        number: Planned(
            job=timed[number],
            name=job.rule.name,
            log=Path(job.log[0]) if job.log else None,
            benchmark=Path(job.benchmark) if job.benchmark else None,
            is_finished=job not in needed,
        )
        for job, number in numbers.items()
    }


def follow_run():
    """Follow the run from here on, unless nothing is to be shown."""
    global PROGRESS
    quiet = workflow.output_settings.quiet or set()
    if TERMINAL_HANDLER is None or quiet & {Quietness.ALL, Quietness.PROGRESS}:
        return
    PROGRESS = RunProgress(
        planned_jobs(),
        workflow.resource_settings.cores if workflow.local_exec else workflow.nodes,
        PROGRESS_LINE,
        stops_at_failure=not (
            workflow.execution_settings.keep_going
            or workflow.execution_settings.retries
        ),
    )
    logger.addHandler(PROGRESS)


PROGRESS = None
