"""Fuzzy systems learned from tables, or from functions and controllers that they imitate.

What is learned is an ordinary system of `fis_tools.model`: readable terms, and rules to audit, explain,
review and export. `FuzzyRegressor` and `FuzzyClassifier` need scikit-learn (``fis-tools[learn]``); the rest
does not.
"""

from typing import TYPE_CHECKING, Any

from fis_tools.learning.learner import Imitation, Recipe, imitate, learn

if TYPE_CHECKING:
    from fis_tools.learning.estimators import FuzzyClassifier, FuzzyRegressor

__all__ = ["FuzzyClassifier", "FuzzyRegressor", "Imitation", "Recipe", "imitate", "learn"]


def __getattr__(name: str) -> Any:
    """Fetch an estimator, which imports scikit-learn."""
    if name in ("FuzzyClassifier", "FuzzyRegressor"):
        from fis_tools.learning import estimators  # noqa: PLC0415 - takes long, and is an extra

        return getattr(estimators, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
