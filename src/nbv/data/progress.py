"""The log of long work on the objects of a data set."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")

logger = logging.getLogger(__name__)

_SECONDS_BETWEEN_LINES = 5.0


def logged(items: Iterable[T], n_items: int, what: str) -> Iterator[T]:
    """Yield items; log how many are done and the time left, and at last the time taken."""
    start = last = time.monotonic()
    for done, item in enumerate(items, 1):
        yield item
        now = time.monotonic()
        if now - last >= _SECONDS_BETWEEN_LINES and done < n_items:
            last = now
            left = (now - start) / done * (n_items - done)
            logger.info("%s: %d of %d, %.0f s left", what, done, n_items, left)
    logger.info("%s: %d in %.1f s", what, n_items, time.monotonic() - start)
