"""scikit-fuzzy's own inference, the definition that the engines are compared with."""

import numpy as np
from skfuzzy import control
from skfuzzy.control.controlsystem import CrispValueCalculator

from fis_tools.array_types import Floats
from fis_tools.model import FuzzySystem, Variable
from tests.fis_tools.control_systems import build_control_system

#: Results that a reference engine keeps before it empties scikit-fuzzy's cache.
RUNS_KEPT = 1000


class _Sorted(control.ControlSystem):  # type: ignore[misc]
    """A control system that has sorted its rules; scikit-fuzzy's sorts them anew for every sample."""

    def __init__(self, plain: control.ControlSystem) -> None:
        super().__init__()
        self.graph = plain.graph
        self._rules = list(plain.rules)

    @property
    def rules(self) -> list[control.Rule]:
        """Rules in the order of calculation."""
        return self._rules


class ReferenceEngine:
    """Inference by scikit-fuzzy's own ``compute()``: slow, and the definition of what is right.

    Parameters
    ----------
    system : FuzzySystem
        What to evaluate.
    """

    def __init__(self, system: FuzzySystem) -> None:
        self.system = system
        # Flushing inside `compute` would take the cuts away before `_fires` can look at them.
        self._simulation = control.ControlSystemSimulation(
            _Sorted(build_control_system(system)), flush_after_run=2 * RUNS_KEPT
        )
        self._runs = 0
        self._outputs = {variable.label: variable for variable in self._simulation.ctrl.consequents}

    def compute(self, inputs: Floats) -> Floats:
        """Infer the outputs for one sample.

        Parameters
        ----------
        inputs : (num_inputs,)
            In the order of the system's inputs; clipped to the universes.

        Returns
        -------
        (num_outputs,)
            An output's default where no rule that concludes on it fires.

        Raises
        ------
        ValueError
            If there are too few or too many inputs, or one is NaN (scikit-fuzzy would not care).
        """
        values = np.asarray(inputs, dtype=np.float64)
        if values.shape != (len(self.system.inputs),):
            raise ValueError(f"inputs have shape {values.shape}; pass one number for each input")
        if np.isnan(values).any():
            raise ValueError("an input is NaN; pass numbers, those out of range are clipped")
        self._runs += 1
        if self._runs % RUNS_KEPT == 0:
            self._simulation.reset()
        for variable, value in zip(self.system.inputs, values, strict=True):
            self._simulation.input[variable.name] = float(value)
        # A repeated input that fires no rule leaves the previous output in place: start from none.
        self._simulation.output = {}
        with np.errstate(divide="ignore", invalid="ignore"):  # a bisector of an area with a gap
            self._simulation.compute()
        return np.array([self._crisp(variable) for variable in self.system.outputs])

    def _crisp(self, variable: Variable) -> float:
        assert variable.default is not None
        if variable.name not in self._simulation.output or not self._fires(variable):
            return variable.default
        return float(self._simulation.output[variable.name])

    def _fires(self, variable: Variable) -> bool:
        """Return whether anything is left to defuzzify; scikit-fuzzy asks this for areas only."""
        if self.system.defuzzifier_of(variable) in {"centroid", "bisector"}:
            return True
        calculator = CrispValueCalculator(self._outputs[variable.name], self._simulation)
        _, aggregated, _ = calculator.find_memberships()
        return bool(aggregated.sum() > 0)
