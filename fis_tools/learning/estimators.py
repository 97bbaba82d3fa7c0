"""Fuzzy systems as estimators of scikit-learn: in pipelines, in searches, and open to a reader."""

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.errors import MissingExtra
from fis_tools.learning.learner import Consequents, Learned, Recipe, learn_classes, learn_number
from fis_tools.learning.rules import range_of
from fis_tools.learning.table import Column, columns_over, distinct
from fis_tools.model import FuzzySystem

try:
    from sklearn.base import BaseEstimator, ClassifierMixin, RegressorMixin
    from sklearn.utils.multiclass import check_classification_targets
    from sklearn.utils.validation import check_is_fitted, validate_data
except ModuleNotFoundError as missing:
    raise MissingExtra("an estimator", "scikit-learn", "scikit-learn") from missing


class _FuzzyEstimator(BaseEstimator):
    """What both estimators share: a learned system, and the columns that it is fed with."""

    system_: FuzzySystem

    def _columns(self, rows: Floats) -> list[Column]:
        labels = getattr(self, "feature_names_in_", [f"x{place}" for place in range(rows.shape[1])])
        return columns_over(rows, list(map(str, labels)))

    def _keep(self, learned: Learned) -> Self:
        self.system_ = learned.system
        self.input_columns_ = np.array(learned.columns)
        return self

    def _infer(self, X: ArrayLike) -> Floats:
        check_is_fitted(self)
        rows = validate_data(self, X, reset=False, dtype=np.float64)
        fed: Floats = np.ascontiguousarray(rows[:, self.input_columns_])
        return compile(self.system_)(fed)


class FuzzyRegressor(RegressorMixin, _FuzzyEstimator):
    """A number from the rules of a fuzzy system that is learned from a table.

    Parameters
    ----------
    consequents, terms, output_terms, max_inputs, tune
        See `fis_tools.learning.learner.Recipe`.

    Attributes
    ----------
    system_ : FuzzySystem
        What was learned. Nothing is drawn, so that the same table gives the same system.
    input_columns_ : (num_inputs,) int
        Which columns of a table are its inputs.
    """

    def __init__(
        self,
        consequents: Consequents = "constants",
        terms: int = 3,
        output_terms: int = 5,
        max_inputs: int = 3,
        tune: bool = True,
    ) -> None:
        self.consequents = consequents
        self.terms = terms
        self.output_terms = output_terms
        self.max_inputs = max_inputs
        self.tune = tune

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Learn from a table, (n, num_features), and a number for each row, (n,)."""
        rows, values = validate_data(self, X, y, dtype=np.float64, y_numeric=True, ensure_min_samples=2)
        values = np.asarray(values, dtype=np.float64)
        recipe = Recipe(**self.get_params())
        target = Column("y", "", *range_of(values))
        return self._keep(learn_number(self._columns(rows), rows, target, values, recipe))

    def predict(self, X: ArrayLike) -> Floats:
        """Return the number of each row, (n,)."""
        answers: Floats = self._infer(X)[:, 0]
        return answers


class FuzzyClassifier(ClassifierMixin, _FuzzyEstimator):
    """A class from the rules of a fuzzy system that is learned from a table.

    The system has an output for each class: the share of the class among rows of such inputs.

    Parameters
    ----------
    terms, max_inputs, tune
        See `fis_tools.learning.learner.Recipe`.

    Attributes
    ----------
    system_ : FuzzySystem
        What was learned. Nothing is drawn, so that the same table gives the same system.
    classes_ : (num_classes,)
        In the order of the system's outputs.
    input_columns_ : (num_inputs,) int
        Which columns of a table are its inputs.
    """

    def __init__(self, terms: int = 3, max_inputs: int = 3, tune: bool = True) -> None:
        self.terms = terms
        self.max_inputs = max_inputs
        self.tune = tune

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Learn from a table, (n, num_features), and a class for each row, (n,)."""
        rows, labels = validate_data(self, X, y, dtype=np.float64, ensure_min_samples=2)
        check_classification_targets(labels)
        self.classes_, place = np.unique(labels, return_inverse=True)
        names = [label if isinstance(label, str) else f"class_{label}" for label in self.classes_.tolist()]
        owners = np.eye(len(names))[place]
        recipe = Recipe(**self.get_params())
        return self._keep(learn_classes("y", self._columns(rows), rows, distinct(names), owners, recipe))

    def predict_proba(self, X: ArrayLike) -> Floats:
        """Return the share of each class for each row, (n, num_classes), with a sum of one."""
        shares = self._infer(X)
        total = shares.sum(axis=1, keepdims=True)
        prior = np.array([output.default for output in self.system_.outputs])
        shares = np.where(total > 0.0, shares, prior)
        normalised: Floats = shares / shares.sum(axis=1, keepdims=True)
        return normalised

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """Return the class of the greatest share of each row, (n,)."""
        shares = self.predict_proba(X)
        found: NDArray[Any] = self.classes_[shares.argmax(axis=1)]
        return found
