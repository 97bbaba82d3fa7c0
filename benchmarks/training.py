"""What every training of a policy here is about, and how it is told beside the policy."""

import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

from benchmarks.acting import Acting

Settings = TypeVar("Settings", bound=Acting)


@dataclass(frozen=True)
class Training(Generic[Settings]):
    """One training, and what it is about.

    Parameters
    ----------
    folder : Path
        Where policies are written.
    settings : Settings
    seed : int
    budget : int
        Control periods, of which no more are flown.
    words : tuple of str
        Of the world, after those of the settings.
    """

    folder: Path
    settings: Settings
    seed: int = 1
    budget: int = 1_000_000
    words: tuple[str, ...] = ()
    #: when it began, s
    begun: float = field(default_factory=time.process_time, init=False)

    @property
    def every_word(self) -> list[str]:
        """The words of the world."""
        return [*self.settings.words, *self.words]

    def told(self, done: int, flights: int) -> dict[str, Any]:
        """Return how the training went so far: after so many control periods and flights."""
        return {
            "seed": self.seed,
            "budget": self.budget,
            "words": self.every_word,
            "settings": asdict(self.settings),
            "done": done,
            "flights": flights,
        }
