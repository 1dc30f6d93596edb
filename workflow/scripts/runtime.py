"""Sum up what the jobs cost."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.files import write_csv, write_text
    from nbv.reporting.runtime import load_runtime, runtime_markdown

    params, results = snakemake.params, Path(snakemake.output[0]).parents[1]
    runtime = load_runtime(results, params.units, params.n_folds)
    write_csv(snakemake.output.csv, runtime)
    write_text(snakemake.output.md, runtime_markdown(runtime))
