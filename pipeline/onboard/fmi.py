"""What an FMI block of an export is made of: variables, and functions of the standard that it leaves out."""

from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import count
from typing import Any, NamedTuple

from pipeline.onboard.fields import InterfaceField, offsets
from pipeline.onboard.interface import Interface

#: units of the block, by exponents of those of the SI
UNITS = {"m": {"m": 1}, "m/s": {"m": 1, "s": -1}, "N": {"kg": 1, "m": 1, "s": -2}, "rad": {"rad": 1}}
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
    about: str
    unit: str
    limits: tuple[float, float] | None
    causality: str
    variability: str
    start: float | None


def _fields(interface: Interface) -> Iterator[tuple[InterfaceField, str, str]]:
    """Return fields in the order of their references, each with its causality and variability.

    The block counts the periods itself; the Sun at the start is what its inputs are then.
    """
    inputs = [each for each in interface.step if each.name != "period"]
    names = {each.name for each in inputs}
    fixed = [each for each in interface.start if each.name not in names]
    yield from ((each, "input", "discrete") for each in inputs)
    yield from ((each, "parameter", "fixed") for each in fixed)
    yield from ((each, "parameter", "tunable") for each in interface.parameters)
    yield from ((each, "output", "discrete") for each in interface.output)


def variables(interface: Interface) -> Iterator[BlockVariable]:
    """Return the variables in the order of their references: inputs, parameters, outputs."""
    numbers = count()
    for field, causality, variability in _fields(interface):
        # an age beyond its limits says that an input is old, which a host may say
        limits = None if field in interface.ages else field.limits
        for index, start in enumerate(field.starts, start=1):
            name = f"{field.name}[{index}]" if field.is_array else field.name
            facts = field.comment, field.unit, limits, causality, variability
            yield BlockVariable(next(numbers), name, *facts, None if causality == "output" else start)


class BlockLayout(NamedTuple):
    """How many numbers are inputs, how many can be set, how many are read, and where each field begins."""

    num_inputs: int
    num_set: int
    num_outputs: int  # with the time
    at: Mapping[str, int]


def _layout(interface: Interface) -> BlockLayout:
    rows = list(_fields(interface))
    counts = Counter[str]()
    for field, causality, _ in rows:
        counts[causality] += field.count
    firsts = offsets([field for field, *_ in rows])
    return BlockLayout(
        counts["input"],
        counts["input"] + counts["parameter"],
        counts["output"] + 1,
        {field.name: first for (field, *_), first in zip(rows, firsts, strict=True)},
    )


def block_facts(interface: Interface) -> dict[str, Any]:
    """Return what the templates of the block ask for."""
    return {
        "fmi_variables": list(variables(interface)),
        "fmi": _layout(interface),
        "units": UNITS,
        "not_offered": NOT_OFFERED,
        "no_instance": NO_INSTANCE,
    }
