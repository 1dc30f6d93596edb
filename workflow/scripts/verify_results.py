"""Compare every file of a run with the checksum that was recorded when it was written."""

from nbv.experiment.run.jobs import SOUND, job, states_of_files

with job(snakemake):
    import logging
    import shlex

    from nbv.errors import UserError

    params = snakemake.params
    states = states_of_files(params.run)
    damaged = [path for path, state in states.items() if state not in SOUND]
    for path in damaged:
        logging.error("%s %s", path, states[path])
    if damaged:
        command = shlex.join(["snakemake", *damaged, "--force", *params.options])
        raise UserError(
            f"{len(damaged)} of {len(states)} files may be damaged; make them again: {command}"
        )
    missing = sum(state == "is missing" for state in states.values())
    logging.info(
        "%d files are as written, %d are missing",
        *(len(states) - missing, missing),
        extra={"for_terminal": True},
    )
