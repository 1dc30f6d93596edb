# Reference results under version control: one rule compares a run with them, one makes them.
# Both run only where somebody asks for them.

import os

from nbv.experiment.reference import find_reference

REFERENCES = Path(os.path.relpath(BASE / "docs/reference"))


rule compare:
    input:
        sources("compare_with_reference"),
        reference=reference_of_run,
        report=rules.report.output[0],
    log:
        LAYOUT.log("compare"),
    conda:
        ENVIRONMENT
    params:
        run=lambda wildcards, input: str(Path(input.report).parent),
    script:
        f"{SCRIPTS}/compare_with_reference.py"


rule reference:
    input:
        sources("keep_reference"),
        report=rules.report.output[0],
    log:
        LAYOUT.log("reference"),
    conda:
        ENVIRONMENT
    params:
        run=lambda wildcards, input: str(Path(input.report).parent),
        reference=str(REFERENCES / CONFIG["name"]),
    script:
        f"{SCRIPTS}/keep_reference.py"
