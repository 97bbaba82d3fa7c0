"""What an FMI block of an export is made of: variables, and functions of the standard that it leaves out."""

from collections.abc import Iterator
from hashlib import sha256
from typing import Any, NamedTuple

#: numbers that the block is given in turn, by name, with what they start with
INPUTS = (
    *((f"position_m[{axis}]", 0.0) for axis in (1, 2, 3)),
    *((f"velocity_m_s[{axis}]", 0.0) for axis in (1, 2, 3)),
    *((f"attitude[{part}]", float(part == 4)) for part in (1, 2, 3, 4)),
    *((f"{angle}[{part}]", float(part == 1)) for angle in ("sun_angle", "sun_elevation") for part in (1, 2)),
    ("is_given", 0.0),
    *((f"given_n[{axis}]", 0.0) for axis in (1, 2, 3)),
)
OUTPUTS = (
    *(
        f"{vector}[{axis}]"
        for vector in ("force_n", "inferred_n", "reason", "leading_rule")
        for axis in (1, 2, 3)
    ),
    *("status", "safety_limit"),
)
_TYPES = ("Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
_ACCESS = tuple(f"{verb}{kind}" for verb in ("Get", "Set") for kind in ("Boolean", "String"))
#: functions that a table of either version holds, and that the block answers with an error
NOT_OFFERED = {
    2: (
        *_ACCESS,
        *("GetInteger", "SetInteger", "GetDirectionalDerivative", "SetRealInputDerivatives"),
        *("GetRealOutputDerivatives", "CancelStep", "GetStatus", "GetRealStatus", "GetIntegerStatus"),
        *("GetBooleanStatus", "GetStringStatus"),
    ),
    3: (
        *_ACCESS,
        *(f"{verb}{kind}" for verb in ("Get", "Set") for kind in (*_TYPES, "Binary", "Clock")),
        *(f"{verb}{kind}" for verb in ("Get", "Set") for kind in ("IntervalDecimal", "IntervalFraction")),
        *(f"{verb}{kind}" for verb in ("Get", "Set") for kind in ("ShiftDecimal", "ShiftFraction")),
        *("GetNumberOfVariableDependencies", "GetVariableDependencies"),
        *("GetDirectionalDerivative", "GetAdjointDerivative", "GetOutputDerivatives", "EnterEventMode"),
        *("EnterConfigurationMode", "ExitConfigurationMode", "EnterStepMode", "EvaluateDiscreteStates"),
        *("UpdateDiscreteStates", "ActivateModelPartition", "EnterContinuousTimeMode", "SetTime"),
        *("CompletedIntegratorStep", "SetContinuousStates", "GetContinuousStateDerivatives"),
        *("GetEventIndicators", "GetContinuousStates", "GetNominalsOfContinuousStates"),
        *("GetNumberOfEventIndicators", "GetNumberOfContinuousStates"),
    ),
}
#: of the third version, those that return an instance: none
NO_INSTANCE = ("InstantiateModelExchange", "InstantiateScheduledExecution")


class BlockVariable(NamedTuple):
    """A variable of the block; an output starts with nothing."""

    number: int
    name: str
    causality: str
    variability: str
    start: float | None


def variables(num_points: int) -> Iterator[BlockVariable]:
    """Return the variables in the order of their references: inputs, parameters, outputs."""
    points = range(1, num_points + 1)
    inputs = [*INPUTS, *((f"unseen[{point}]", 1.0) for point in points)]
    rows = [
        *((name, "input", "discrete", start) for name, start in inputs),
        *((f"counts[{point}]", "parameter", "fixed", 1.0) for point in points),
        *((name, "output", "discrete", None) for name in OUTPUTS),
    ]
    for number, row in enumerate(rows):
        yield BlockVariable(number, *row)


def block_facts(code: str, num_points: int) -> dict[str, Any]:
    """Return what the templates of the block ask for; its token is a digest of the controller's source."""
    return {
        "token": sha256(code.encode()).hexdigest(),
        "fmi_variables": list(variables(num_points)),
        "not_offered": NOT_OFFERED,
        "no_instance": NO_INSTANCE,
    }
