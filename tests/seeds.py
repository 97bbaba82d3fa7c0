"""Many random cases, of which a developer waits for few."""

import pytest


def seeds(count: int, quick: int) -> list[object]:
    """Return the numbers below `count`; all but the first `quick` are slow."""
    return [seed if seed < quick else pytest.param(seed, marks=pytest.mark.slow) for seed in range(count)]
