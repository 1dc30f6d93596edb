# What the rules of the transfer table share: conditions, and the files made under them.

import functools

TRANSFER = CONFIG["transfer"]
CONDITIONS = list(TRANSFER["conditions"])
TRANSFER_UNIT = (TRANSFER["category"] or FOCUS, TRANSFER["elevation_deg"])
TRANSFER_FOLDS = TRANSFER["folds"] or list(FOLDS)
# What is trained on, and what is tested on; paths go on with the unit and the fold.
PAIR = "{trained}/{tested}"


wildcard_constraints:
    condition="|".join(CONDITIONS),
    trained="|".join(CONDITIONS),
    tested="|".join(CONDITIONS),


@functools.cache
def condition_settings(name):
    try:
        settings = load_condition(
            BASE / "config", OVERRIDES, CONFIG, TRANSFER["conditions"][name]
        )
        check_sensor(settings["sensor"], [TRANSFER_UNIT[0]])
    except UserError as error:
        stop(error)
    return settings


def of_condition(path, name):
    """A file of the run itself where it was made under that very condition."""
    settings = condition_settings(name)
    is_run = TRANSFER_UNIT in UNITS and all(
        settings[key] == CONFIG[key] for key in ("camera", "sensor")
    )
    if is_run:
        return f"{RESULTS}/{path}"
    stage, rest = path.split("/", 1)
    return f"{RESULTS}/transfer/{stage}/{name}/{rest}"


def depth_of(name):
    return of_condition("depth/{category}/el{elevation}.npy", name)
