"""What of Snakemake's own messages a run shows: what went wrong, and what the user has to know."""

from __future__ import annotations

import logging
from collections.abc import Callable

# Snakemake says these about every run that does nothing or that is interrupted.
_FOR_THE_USER = ("Nothing to be done", "Terminating processes", "Will exit after")
# Said before Snakemake knows whether it will run jobs.
_ALWAYS_CHATTER = "Assuming unrestricted shared filesystem usage"
# The job said it before, in words of its own, and the end of the run says it again.
_SAID_BETTER = ("Exiting because a job execution failed", "At least one job did not complete")


class WithoutChatter(logging.Filter):
    """Lets a message pass where the user has to know of it; makes room for it.

    Parameters
    ----------
    is_running : callable
        Whether Snakemake runs jobs. Whatever else it does, such as a dry run, is to be read.
    make_room : callable
        Called before a message is written.
    """

    def __init__(self, is_running: Callable[[], bool], make_room: Callable[[], None]) -> None:
        super().__init__()
        self._is_running, self._make_room = is_running, make_room

    def filter(self, record: logging.LogRecord) -> bool:
        """Say whether a message is shown."""
        is_chatter = str(record.msg).startswith(_ALWAYS_CHATTER)
        if is_chatter or (self._is_running() and not tells_the_user(record)):
            return False
        self._make_room()
        return True


def tells_the_user(record: logging.LogRecord) -> bool:
    """Say whether a message of a run is for its user: a warning, an error, or the end of it.

    Not what a job has said itself: a script that ends with another status than 0 has given its
    reason. One that a signal ended has not.
    """
    message = str(record.msg)
    if record.levelno < logging.WARNING:
        return message.startswith(_FOR_THE_USER)
    is_of_job = "CalledProcessError" in message and "returned non-zero exit status" in message
    return not is_of_job and not any(said in message for said in _SAID_BETTER)
