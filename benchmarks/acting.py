"""When a policy acts, by what force, and what its flights are paid while it learns, whoever trains it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

#: offset between the seeds of the starts of two trainings
SEEDS_APART: Final = 1_000_000


@dataclass(frozen=True, kw_only=True)
class Acting:
    """When a policy acts, and what it is paid.

    Parameters
    ----------
    words : tuple of str
        Of the world, as on the command line.
    decision_period_s : float, optional
        As of the environments.
    silent : float
        A share of the force that is too small to fire, by which every force is less: so silence is easily
        learned.
    first_price, last_price : float
        Of a m/s of fuel, with a point worth 0.1; it approaches the last geometrically between the shares
        `dearer` of the training, so that something is inspected before fuel is saved.
    success : float
        Paid once.
    """

    words: tuple[str, ...] = ()
    decision_period_s: float | None = None
    silent: float = 0.0
    first_price: float = 0.1
    last_price: float = 1.0
    dearer: tuple[float, float] = (0.3, 0.9)
    success: float = 1.0

    def price(self, done: float) -> float:
        """Return the price of a m/s after a share of the training."""
        begins, ends = self.dearer
        share = min(max((done - begins) / (ends - begins), 0.0), 1.0)
        return self.first_price * (self.last_price / self.first_price) ** share


#: a decision a minute
MINUTE: Final[Mapping[str, Any]] = {
    "words": ("deputy.max_force_n=0.3",),
    "decision_period_s": 60.0,
    "silent": 0.02,
    "first_price": 0.3,
    "last_price": 3.0,
    "dearer": (0.15, 0.65),
    "success": 2.0,
}
#: taken away outside the limits, unless something else is asked for
OUTSIDE: Final = 10.0
