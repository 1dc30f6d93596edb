"""Hold the results against the reference that is kept for their name."""

import logging
from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.errors import UserError
    from nbv.evaluation.compare import compare_runs

    log = logging.getLogger(__name__)
    reference = Path(snakemake.input.reference).parent
    results = Path(snakemake.input.report).parent
    comparison = compare_runs(reference, results)
    # With other settings most cells differ, and rightly so: the log has them for who wants them.
    aside = {"log_only": bool(comparison.settings)}
    for line in comparison.lines():
        log.info("%s", line, extra=aside)
    if comparison.settings:
        raise UserError(f"{comparison.settings_line()} (cell by cell in {snakemake.log[0]})")
    if not comparison.agrees:
        raise UserError(
            f"{results} does not agree with {reference} (see the lines above, or "
            f"{snakemake.log[0]})"
        )
