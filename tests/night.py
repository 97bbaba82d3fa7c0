"""What each night tries whole, and by day in part: ``EVERY_EXPERIMENT=1`` in the environment."""

import os
from collections.abc import Sequence
from typing import TypeVar

Each = TypeVar("Each")

#: whether this is the night's run
IS_WHOLE = os.environ.get("EVERY_EXPERIMENT") == "1"


def by_day(items: Sequence[Each], step: int) -> Sequence[Each]:
    """Return every so-manieth item, the first among them; all of them by night."""
    return items if IS_WHOLE else items[::step]


def count(by_day: int, by_night: int) -> int:
    """Return how many of something are tried."""
    return by_night if IS_WHOLE else by_day
