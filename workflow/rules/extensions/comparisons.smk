# Tables that compare this run with finished ones. They are made only where somebody asks for them.

from nbv.reporting.extensions.densities import METHODS as DENSITY_METHODS


def compared_runs():
    """This run's name, then those that it is compared with."""
    return list(dict.fromkeys([CONFIG["name"], *CONFIG["compared_runs"]]))


def methods_in(run):
    """All methods of a run whose second estimates do not depend on other extensions."""
    settings = run_settings(run)
    own = [
        name
        for name, method in settings["extensions"].items()
        if method["fusion"] == "product"
    ]
    return [
        *settings["methods"],
        *(own if run_settings(run)["gives_distributions"] else []),
    ]


def density_methods(run):
    """The methods whose errors tell what a density brings."""
    kinds = [
        "estimate",
        *(["posterior"] if run_settings(run)["gives_distributions"] else []),
    ]
    return sorted({name for kind in kinds for name in DENSITY_METHODS[kind].values()})


def compared_keys(names_of):
    """Run, category, elevation, fold, and one of the names that a run has, of every file."""
    return [
        (run, *fold, name)
        for run in compared_runs()
        for fold in folds_of(REFERENCE_UNITS)
        for name in names_of(run)
    ]


def compared(path, names_of):
    """The files of all runs. Those of other runs are not made here; they have to be there."""

    def files(wildcards):
        return [
            run_file(run, path(Layout(f"results/{run}"), *place), "compared_runs")
            for run, *place in compared_keys(names_of)
        ]

    return files


def proposed_lookup(run):
    return [run_settings(run)["methods"][SETTINGS.subject]["policy"]]


def test_estimates(run):
    return ["test"]


def test_posteriors(run):
    return ["test"] if run_settings(run)["gives_distributions"] else []


rule density_comparison:
    input:
        sources("tabulate_density_comparison"),
        evaluations=compared(Layout.evaluation, density_methods),
        estimates=compared(Layout.estimates, test_estimates),
        lookups=compared(Layout.lookup, proposed_lookup),
        posteriors=compared(Layout.posteriors, test_posteriors),
    output:
        csv=LAYOUT.table("density_comparison", "csv"),
        md=LAYOUT.table("density_comparison", "md"),
        tex=LAYOUT.table("density_comparison", "tex"),
    log:
        LAYOUT.log("density_comparison"),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        evaluations=lambda wildcards: compared_keys(density_methods),
        estimates=lambda wildcards: compared_keys(test_estimates),
        lookups=lambda wildcards: compared_keys(proposed_lookup),
        posteriors=lambda wildcards: compared_keys(test_posteriors),
        settings=RESAMPLED,
    script:
        "../../scripts/tabulate_density_comparison.py"


rule run_comparison:
    input:
        sources("tabulate_run_comparison"),
        evaluations=compared(Layout.evaluation, methods_in),
    output:
        csv=LAYOUT.table("run_comparison", "csv"),
        md=LAYOUT.table("run_comparison", "md"),
        tex=LAYOUT.table("run_comparison", "tex"),
    log:
        LAYOUT.log("run_comparison"),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        evaluations=lambda wildcards: compared_keys(methods_in),
        settings=RESAMPLED,
    script:
        "../../scripts/tabulate_run_comparison.py"
