"""Compare the results with the reference that is kept for their name."""

import logging
from pathlib import Path

from nbv.experiment.run.jobs import job, need_intact

with job(snakemake):
    from nbv.errors import UserError
    from nbv.experiment.run.compare import compare_runs

    reference, run = Path(snakemake.input.reference).parent, Path(snakemake.params.run)
    need_intact(snakemake.params.run)
    comparison = compare_runs(reference, run)
    for line in comparison.lines():
        logging.getLogger(__name__).info("%s", line, extra={"for_terminal": True})
    if not comparison.agrees:
        raise UserError(
            f"{run} does not agree with {reference} (the lines above, also in "
            f"{snakemake.log[0]}, say where)"
        )
