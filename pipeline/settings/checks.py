"""Types of settings with their limits, groups of settings, and checks of several settings together.

Groups are frozen dataclasses whose values pydantic checks, and whose errors are sentences. A key whose number
has no effect is no key: it is not in a run's configuration, and giving it is a mistake.
``Only("navigation.mode=fixes")`` among the annotations of a key, or given to the class for all keys of its
group, says so once, for the check, the help and the reference page.

Every error states the fact, what is expected and how to get there. Checks of single values are run by
pydantic; in their messages ``{key}`` stands for the setting's key and ``{unit}`` for its unit in brackets.
Comparisons are written so that NaN, which compares false with everything, never passes.
"""

import inspect
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache
from typing import (
    Annotated,
    Any,
    ClassVar,
    Literal,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    Strict,
    ValidationError,
    ValidationInfo,
)
from pydantic.dataclasses import dataclass as checked_dataclass
from pydantic_core import CoreSchema, core_schema

from pipeline.settings.keys import FREE, KNOWN, choices_of, did_you_mean, dotted, unit_of, unknown, value_at


class SettingError(ValueError):
    """A setting with an invalid value."""


class Freely:
    """Marks settings that no result depends on, such as how a command shares out its work."""


class Follows:
    """Marks settings that may be null, and are then what the mission asks for."""


@dataclass(frozen=True)
class Cure:
    """End of the message about a number that is too small, such as that null is allowed."""

    words: str


def _whole(value: Any) -> Any:
    """Accept a whole number written like 1e3."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _long(length: int, words: str) -> AfterValidator:
    """Return a validator of the length of a list of numbers; `words` says in its message what they are."""

    def check(values: tuple[float, ...]) -> tuple[float, ...]:
        if len(values) != length:
            raise ValueError(f"{{key}} has {len(values)} numbers; it must have {words}")
        return values

    return AfterValidator(check)


def _unit_vector(values: tuple[float, ...]) -> tuple[float, ...]:
    length = math.hypot(*values)
    if not abs(length - 1.0) < 1e-6:
        raise ValueError(
            f"{{key}} has length {length:.6g}; it must be a unit vector: divide it by its length"
        )
    return values


def _pair(values: tuple[float, ...]) -> tuple[float, ...]:
    if len(values) != 2:
        raise ValueError(f"{{key}} is {list(values)}; it must be a lower and an upper bound, [low, high]")
    if not values[0] < values[1]:
        raise ValueError(
            f"{{key}}[0] is {values[0]} and {{key}}[1] is {values[1]}; the first must be less than the "
            "second{unit}"
        )
    return values


def _box(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if len(rows) != 2 or any(len(row) != 6 for row in rows):
        raise ValueError(
            "{key} must be two rows of six numbers: the least and the greatest x, y, z (m), x', y', z' (m/s)"
        )
    if not all(low <= high for low, high in zip(*rows, strict=True)):
        raise ValueError(
            f"{{key}} is {[*map(list, rows)]}; no number of its first row may be above that of the second"
        )
    return rows


def _thrusters(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    """Raise ValueError unless each has a position, a unit vector and a maximum force."""
    if not 4 <= len(rows) <= 64:
        raise ValueError(f"{{key}} has {len(rows)} rows, one a thruster; there must be from 4 to 64")
    for which, row in enumerate(rows):
        if len(row) != 7 or not abs(math.hypot(*row[3:6]) - 1.0) < 1e-6 or not row[6] > 0.0:
            raise ValueError(
                f"{{key}}[{which}] is {list(row)}; it must be seven numbers: the place [x, y, z] (m), the "
                "unit vector of its force [x, y, z], both in body axes, and the greatest force (N)"
            )
    import numpy as np  # noqa: PLC0415 - few runs need it to check their settings

    directions = np.array(rows, dtype=np.float64)[:, 3:6]
    # if all lie on one side of a plane, then of one that passes through two of them
    sides = np.cross(directions[:, np.newaxis], directions).reshape(-1, 3)
    sides = sides[np.linalg.norm(sides, axis=1) > 1e-9] @ directions.T
    if np.linalg.matrix_rank(directions) < 3 or np.any(sides.min(axis=1) > -1e-9):
        raise ValueError("{key} cannot push in every direction; add a thruster that pushes where none does")
    return rows


def _inertia(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    """Raise ValueError unless it is symmetric, positive definite and obeys the triangle inequality."""
    if len(rows) != 3 or any(len(row) != 3 for row in rows):
        raise ValueError(f"{{key}} is {rows}; it must be three rows of three numbers in kg m^2")
    if not all(math.isclose(rows[i][j], rows[j][i], rel_tol=1e-9) for i, j in ((0, 1), (0, 2), (1, 2))):
        raise ValueError(f"{{key}} is {[*map(list, rows)]}, not symmetric; set [i][j] equal to [j][i]")
    moments = _principal_moments(rows)
    listed = ", ".join(f"{moment:.6g}" for moment in moments)
    if not moments[0] > 1e-12 * abs(moments[2]):
        raise ValueError(
            f"{{key}} has the principal moments {listed} kg m^2; all must be greater than 0, "
            "or the body cannot turn by Euler's equation"
        )
    if not moments[0] + moments[1] >= moments[2] * (1.0 - 1e-9):
        raise ValueError(
            f"{{key}} has the principal moments {listed} kg m^2; no rigid body has one greater "
            "than the sum of the other two"
        )
    return rows


def _principal_moments(rows: tuple[tuple[float, ...], ...]) -> Sequence[float]:
    """Return the principal moments of an inertia matrix, ascending."""
    if not any(rows[i][j] for i in range(3) for j in range(3) if i != j):
        return sorted(rows[i][i] for i in range(3))
    import numpy as np  # noqa: PLC0415 - as above

    return [float(moment) for moment in np.linalg.eigvalsh(np.array(rows))]


#: by unit, "" for numbers without one: the least positive and the greatest magnitude that makes sense. Beyond
#: them formulas lose digits, overflow or fill the memory
REACHES: Mapping[str, tuple[float, float]] = {
    "": (1e-9, 1e12),
    "1/s": (1e-9, 1e3),
    "1e6 s^2": (1e-9, 1e12),
    "1/s^2": (1e-12, 1e3),
    "N": (1e-9, 1e6),
    "N m": (1e-9, 1e6),
    "N s": (1e-9, 1e6),
    "m/s^2": (1e-15, 1e3),
    "deg": (1e-6, 360.0),
    "kg": (1e-3, 1e6),
    "kg m^2": (1e-9, 1e9),
    "m": (1e-6, 1e7),
    "m/s": (1e-9, 1e12),  # also of prices
    "rad": (1e-9, 100.0),
    "rad/s": (1e-8, 10.0),
    "s": (1e-3, 1e8),
}


def _not_beyond(value: float, info: ValidationInfo) -> float:
    """Raise ValueError for a number too large for its unit."""
    _, greatest = REACHES.get(unit_of(str(info.field_name)), (0.0, math.inf))
    if not abs(value) <= greatest:
        raise ValueError(f"{{key}} is {value}; it must be at most {greatest:g}{{unit}}, whatever its sign")
    return value


def _not_vanishing(value: float, info: ValidationInfo) -> float:
    """Raise ValueError for a positive number too small for its unit."""
    least, greatest = REACHES.get(unit_of(str(info.field_name)), (0.0, math.inf))
    if 0.0 < value < least:
        raise ValueError(f"{{key}} is {value}; it must be from {least:g} to {greatest:g}{{unit}}")
    return value


Text = Annotated[str, Strict()]
Texts = tuple[Text, ...]
Flag = Annotated[bool, Strict()]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False), AfterValidator(_not_beyond)]
Positive = Annotated[Number, Field(gt=0), AfterValidator(_not_vanishing)]
NotNegative = Annotated[Number, Field(ge=0)]
Share = Annotated[Number, Field(ge=0, le=1)]
Whole = Annotated[int, Strict(), BeforeValidator(_whole)]
#: beyond a million a run takes years or more memory than any computer has
MOST = 1_000_000
Natural = Annotated[Whole, Field(ge=0, le=MOST)]
Count = Annotated[Whole, Field(ge=1, le=MOST)]
#: flown in parts, so that memory hardly grows with them
Cases = Annotated[Whole, Field(ge=1, le=100 * MOST)]
Seed = Annotated[Whole, Field(ge=0, le=2**63 - 1)]
#: worker threads; None is one per processor
Workers = Annotated[Whole | None, Field(ge=1, le=1024), Freely(), Cure(", or null for one a processor")]
Vector = Annotated[tuple[Number, ...], _long(3, "three, [x, y, z]{unit}")]
Thrusters = Annotated[tuple[tuple[Number, ...], ...], AfterValidator(_thrusters)]
#: least and greatest place (m) and velocity (m/s), Hill axes
Box = Annotated[tuple[tuple[Number, ...], ...], AfterValidator(_box)]
UnitVector = Annotated[Vector, AfterValidator(_unit_vector)]
Quaternion = Annotated[
    tuple[Number, ...], _long(4, "four, [q1, q2, q3, q4], scalar last"), AfterValidator(_unit_vector)
]
Inertia = Annotated[tuple[tuple[Number, ...], ...], AfterValidator(_inertia)]
#: a lower and a greater upper bound: of any numbers, of positive ones, of nonnegative ones
Interval = Annotated[tuple[Number, ...], AfterValidator(_pair)]
PositiveInterval = Annotated[tuple[Positive, ...], AfterValidator(_pair)]
NotNegativeInterval = Annotated[tuple[NotNegative, ...], AfterValidator(_pair)]


def within(key: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Raise SettingError if a value is outside [low, high]."""
    if not low <= value <= high:
        raise SettingError(f"{key} is {value}; it must be {expected(low, high)}{in_unit(unit)}")


def expected(low: float | None, high: float) -> str:
    """Return the allowed range in words."""
    if low is None:
        return f"at most {high:g}"
    return f"at least {low:g}" if high == math.inf else f"from {low:g} to {high:g}"


def ascending(low_key: str, low_m: float, high_key: str, high_m: float) -> None:
    """Raise SettingError unless the second of two distances is greater."""
    if not low_m < high_m:
        raise SettingError(
            f"{low_key} is {low_m} and {high_key} is {high_m}; the first must be less than the second (m)"
        )


def divides(key: str, period_s: float, whole_key: str, whole_s: float) -> None:
    """Raise SettingError unless a period fits a whole number of times."""
    ratio = whole_s / period_s
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-9 * ratio:
        fitting = whole_s / max(1, round(ratio))
        raise SettingError(
            f"{key} is {period_s} s and {whole_key} is {whole_s} s; the first must fit into the second a "
            f"whole number of times, as {fitting:g} s does"
        )


def shell(group: str, low_m: float, high_m: float) -> None:
    """Raise SettingError if a shell's inner radius exceeds its outer radius."""
    if not low_m <= high_m:
        raise SettingError(
            f"{group}.min_distance_m is {low_m} and {group}.max_distance_m is {high_m}; the first must not "
            "be greater than the second (m)"
        )


def in_unit(unit: str) -> str:
    """Return a unit in brackets, or nothing."""
    return f" ({unit})" if unit else ""


#: the key whose value is a list, in which one must be
STAGES = "stages"


class Only:
    """The conditions, one of which must hold for a key to exist.

    Parameters
    ----------
    *conditions : str
        ``key=value`` (for stages: one of them is the value), ``key>number``, or ``key``, whose value is then
        not null.
    is_told : bool
        Whether a key that is set where it has no effect is accepted with a note instead of being refused.
    """

    def __init__(self, *conditions: str, is_told: bool = False) -> None:
        self.conditions, self.is_told = conditions, is_told
        self.keys = tuple(re.split("[=>]", condition)[0] for condition in conditions)

    def __eq__(self, other: object) -> bool:
        """Return whether the other has the same conditions."""
        return isinstance(other, Only) and (self.conditions, self.is_told) == (
            other.conditions,
            other.is_told,
        )

    def __hash__(self) -> int:
        """Return a hash of the conditions."""
        return hash(self.conditions)

    @property
    def is_of_stages(self) -> bool:
        """Whether the conditions are about the stages of a run, which may change, not about the flight."""
        return self.is_told or STAGES in self.keys

    def holds(self, config: Mapping[str, Any]) -> bool:
        """Return whether one of the conditions holds in a complete configuration of plain data."""
        return any(_holds(condition, config) for condition in self.conditions)

    def refusal(self, key: str, config: Mapping[str, Any]) -> str:
        """Return a message that a key does not exist in a configuration: why, and the cure."""
        if self.is_of_stages:
            read_by = ", ".join(condition.partition("=")[2] for condition in self.conditions)
            present = _shown(config, STAGES)
            return f"{key} counts in the stages {read_by}, and this run has {present}; leave it out"
        values = " and ".join(f"{other} is {_shown(config, other)}" for other in dict.fromkeys(self.keys))
        return f"{key} counts only with {self}, and {values}; set that, or leave {key} out"

    def __str__(self) -> str:
        return " or ".join(
            condition if "=" in condition or ">" in condition else f"{condition} given"
            for condition in self.conditions
        )


def _holds(condition: str, config: Mapping[str, Any]) -> bool:
    key, sign, wanted = (*re.split("([=>])", condition), "", "")[:3]
    value = value_at(config, key)
    if sign == ">":
        return isinstance(value, int | float) and value > float(wanted)
    if sign == "=":
        return wanted in value if isinstance(value, list) else _word(value) == wanted
    return value is not None


def _shown(config: Mapping[str, Any], key: str) -> str:
    value = value_at(config, key)
    return ", ".join(map(_word, value)) if isinstance(value, list) else _word(value)


def _word(value: Any) -> str:
    """Return a value as YAML writes it."""
    return "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


#: fields that are not part of a configuration
NOT_CONFIGURED = ("mission", "resume")
#: pydantic's names for values of the wrong type, to the right type in words
TYPES: Mapping[str, str] = {
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "string_type": "a text",
    "tuple_type": "a list, [..., ...]",
    "dict_type": "a group of keys",
}


def names_of(kind: Any) -> list[str]:
    """Return the keys of a group, without the group's name."""
    return [field.name for field in fields(kind) if field.name not in NOT_CONFIGURED]


def sentence(kind: Any, error: ValidationError) -> str:
    """Describe the first error: unknown keys before missing ones, and those before invalid values.

    Parameters
    ----------
    kind : type
        The class of settings that was to be built.
    error : ValidationError
    """
    order = {"unexpected_keyword_argument": 0, "missing": 1}
    fault = min(error.errors(include_url=False), key=lambda details: order.get(details["type"], 2))
    cause = fault.get("ctx", {}).get("error")
    if isinstance(cause, SettingError):
        return str(cause)
    key = dotted(kind.group, fault["loc"])
    if fault["type"] == "unexpected_keyword_argument":
        return _unexpected(kind, key)
    if fault["type"] == "missing":
        return f"the key {key} is missing; give it a value, {key}=..."
    if cause is not None:
        return str(cause).replace("{key}", key).replace("{unit}", in_unit(unit_of(key)))
    return f"{key} is {_refused(key, fault, _hint_at(kind, fault['loc']))}"


def _unexpected(kind: Any, key: str) -> str:
    """Return a message about a key that a class does not have: a variant's, or one that does not exist."""
    if kind.group == FREE:
        choices = choices_of(key.rpartition(".")[2], names_of(kind), "keys")
        return f"there is no key {key} with {FREE}.kind={kind.kind}{choices}"
    if key not in KNOWN:
        return unknown(key)
    where = " and ".join(map(str, conditions_of(kind.root, key.rpartition(".")[2])))
    return f"{key} counts only with {where}; set that, or leave {key} out"


def _hint_at(kind: Any, location: tuple[int | str, ...]) -> Any:
    """Return the annotation of the field at a location, or of the mapping that contains it."""
    for name in location:
        inside, *_ = opened(kind)
        if is_dataclass(inside):
            kind = get_type_hints(inside, include_extras=True)[str(name)]
        elif get_origin(inside) is tuple:
            kind = get_args(inside)[0]
    return kind


def _refused(key: str, fault: Mapping[str, Any], hint: Any) -> str:
    """Return the rest of a message about an invalid value: the value, and what it must be."""
    value, (kind, limits, marks) = fault["input"], opened(hint)
    match fault["type"]:
        case "dataclass_type":
            return f"{value!r}; it must be a group of keys: {', '.join(names_of(kind))}"
        case "literal_error":
            return _no_choice(value, get_args(kind))
        case "finite_number":
            return f"{value}; it must be a finite number"
        case name if name in TYPES:
            return f"{value!r}; it must be {TYPES[name]}"
    shown, unit = value if kind is int else float(value), in_unit(unit_of(key))
    words = f"{expected(*ends_of(limits))}{unit}"
    if "gt" in limits and value <= limits["gt"]:
        words = f"greater than {limits['gt']:g}{unit}"
    elif "lt" in limits:  # which is no part of the range
        words = f"less than {limits['lt']:g}" if value >= limits["lt"] else f"at least {limits['ge']:g}"
    elif kind is int and "ge" in limits and value < limits["ge"]:
        cures = [mark.words for mark in marks if isinstance(mark, Cure)]
        words = f"a whole number of at least {limits['ge']}{''.join(cures)}"
    return f"{shown}; it must be {words}"


def _no_choice(value: Any, choices: Sequence[str]) -> str:
    return f"{value!r}; it must be one of {', '.join(choices)}{did_you_mean(str(value), choices)}"


def opened(hint: Any) -> tuple[Any, dict[str, float], list[Any]]:
    """Return the type inside an annotation (without None), its limits by name, and its other metadata."""
    marks: list[Any] = []
    while hasattr(hint, "__metadata__") or type(None) in get_args(hint):
        for mark in getattr(hint, "__metadata__", ()):
            marks += [mark, *getattr(mark, "metadata", ())]
        hint = next(kind for kind in get_args(hint) if kind is not type(None))
    names = ("gt", "ge", "lt", "le")
    limits = {name: getattr(mark, name) for mark in marks for name in names if hasattr(mark, name)}
    return hint, limits, marks


def ends_of(limits: Mapping[str, float]) -> tuple[float | None, float]:
    """Return the least and the greatest number within limits; None and infinity where there is none."""
    return limits.get("gt", limits.get("ge")), limits.get("lt", limits.get("le", math.inf))


#: each class of settings with its group, "" for keys at the top, and what holds for all its keys
GROUPS: list[tuple[str, type[Any], Only | None]] = []

#: of classes of settings: built when first needed, as most commands need few groups; the text below a field
#: describes it
CONFIG = ConfigDict(extra="forbid", defer_build=True)

#: by class of settings, the texts below its fields
DESCRIPTIONS: dict[type[Any], dict[str, str]] = {}


class SettingsType(type):
    """The type of classes of settings, whose calls check values and refuse them in sentences."""

    def __call__(cls, *args: Any, **values: Any) -> Any:
        """Return an instance; of a class with variants that which the tags among the values name.

        Raises
        ------
        SettingError
            For unknown and missing keys, and for values of the wrong type or beyond their limits.
        """
        kind: Any = variant_of(cls, values) if cls.__subclasses__() else cls
        try:
            return type.__call__(kind, *args, **values)
        except ValidationError as error:
            raise SettingError(sentence(kind, error)) from error


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field, Field))
class Settings(metaclass=SettingsType):
    """A group of settings: its subclasses are frozen dataclasses whose values pydantic checks.

    A group whose keys depend on a tag, such as ``navigation.mode``, is a class with variants: subclasses that
    narrow the tag to one value. Calling the class returns the variant that the values name.
    """

    #: of its keys, and the class that the group is entered with
    group: ClassVar[str] = ""
    root: ClassVar[type[Any] | None] = None

    def __init_subclass__(cls, *, group: str | None = None, only: Only | None = None) -> None:
        """Make a subclass a dataclass, and enter its keys among those that are known.

        Parameters
        ----------
        group : str, optional
            Such as ``optimizer.penalty``; empty for keys at the top of the configuration. A class without one
            is a variant, or holds what others share.
        only : Only, optional
            Where its keys exist, except for those that the condition is about.
        """
        hints: list[Any] = [*inspect.get_annotations(cls).values()]
        # reading texts takes a millisecond a class, and a tag has its text elsewhere
        has_texts = not all(get_origin(hint) is Literal and len(get_args(hint)) == 1 for hint in hints)
        config = ConfigDict(**CONFIG, use_attribute_docstrings=has_texts)
        checked_dataclass(cls, config=config, frozen=True, kw_only=True)
        # kept now: pydantic forgets them when it builds the class
        DESCRIPTIONS[cls] = {
            name: " ".join(entry.description.split())
            for owner in reversed(cls.__mro__)
            for name, entry in getattr(owner, "__pydantic_fields__", {}).items()
            if entry.description
        }
        if group is not None:
            cls.group, cls.root = group, cls
            GROUPS.append((group, cls, only))
        if cls.root is not None and cls.group != FREE:
            KNOWN.update(dotted(cls.group, (name,)) for name in names_of(cls))

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Let a class with variants choose, where it is the type of a field."""
        if not cls.__subclasses__():
            return handler(source)

        def built(value: Any) -> Any:
            if isinstance(value, cls):
                return value
            if isinstance(value, Mapping):
                return cls(**{str(name): inside for name, inside in value.items()})
            raise ValueError(f"{{key}} is {value!r}; it must be a group of keys: {', '.join(names_of(cls))}")

        return core_schema.no_info_plain_validator_function(built)


def variants_of(kind: type[Any]) -> list[type[Any]]:
    """Return the variants of a class of settings: its subclasses without subclasses, or itself."""
    return [leaf for inner in kind.__subclasses__() for leaf in variants_of(inner)] or [kind]


def descendants_of(kind: type[Any]) -> Iterator[type[Any]]:
    """Yield all subclasses of a class, each before its own."""
    for inner in kind.__subclasses__():
        yield inner
        yield from descendants_of(inner)


@cache
def tags_of(kind: type[Any]) -> Mapping[str, Mapping[type[Any], str]]:
    """Return the keys that name a variant: by key, its one value in each variant that has it."""
    tags: dict[str, dict[type[Any], str]] = {}
    for variant in variants_of(kind):
        for name, hint in get_type_hints(variant).items():
            if get_origin(hint) is Literal and len(get_args(hint)) == 1:
                tags.setdefault(name, {})[variant] = get_args(hint)[0]
    return tags


def variant_of(kind: Any, values: Mapping[str, Any]) -> type[Any]:
    """Return the variant that the tags among some values name; of a tag that is left out the first counts.

    Raises
    ------
    SettingError
        If there is none.
    """
    variants = variants_of(kind)
    for tag, value_of in tags_of(kind).items():
        choices = list(dict.fromkeys(value_of[variant] for variant in variants if variant in value_of))
        value = values.get(tag, choices[0] if choices else None)
        if choices and value not in choices:
            key = dotted(getattr(kind, "group", ""), (tag,))
            raise SettingError(f"{key} is {_no_choice(value, choices)}")
        variants = [variant for variant in variants if value_of.get(variant, value) == value]
    return variants[0]


def conditions_of(kind: Any, name: str) -> Iterator[Only]:
    """Yield where a key exists, by the variants that have it: a condition for each tag that decides."""
    having = [variant for variant in variants_of(kind) if name in variant.__dataclass_fields__]
    for tag, value_of in tags_of(kind).items():
        values = list(dict.fromkeys(value_of[variant] for variant in having if variant in value_of))
        if tag != name and 0 < len(values) < len({*value_of.values()}):
            yield Only(*(f"{dotted(kind.group, (tag,))}={value}" for value in values))
