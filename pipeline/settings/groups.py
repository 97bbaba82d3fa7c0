"""Groups of settings: frozen dataclasses whose values pydantic checks, and whose errors are sentences.

A key whose number has no effect is no key: it is not in a run's configuration, and giving it is a mistake.
``Only("navigation.mode=fixes")`` among the annotations of a key, or given to the class for all keys of its
group, says so once, for the check, the help and the reference page. So does a variant: of classes among which
a tag chooses, such as ``navigation.mode``, the one whose keys exist.
"""

import ast
import inspect
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import field, fields
from functools import cache
from itertools import pairwise
from typing import Any, ClassVar, Literal, dataclass_transform, get_args, get_origin, get_type_hints

from pydantic import ConfigDict, Field, GetCoreSchemaHandler, ValidationError
from pydantic.dataclasses import dataclass as checked_dataclass
from pydantic_core import CoreSchema, core_schema

from pipeline.settings.checks import SettingError, in_digits, in_unit, no_choice
from pipeline.settings.conditions import Only
from pipeline.settings.keys import FREE, KNOWN, choices_of, dotted, unit_of, unknown

#: each class of settings with its group, "" for keys at the top, and what holds for all its keys
GROUPS: list[tuple[str, type[Any], Only | None]] = []

#: of classes of settings: built when first needed, as most commands need few groups
CONFIG = ConfigDict(extra="forbid", defer_build=True)


class SettingsType(type):
    """The type of classes of settings, whose calls check values and refuse them in sentences."""

    def __call__(cls, *args: Any, **values: Any) -> Any:
        """Return an instance; of a class with variants, of the variant that the values' tags name.

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
    are given one value of the tag, as ``class PerfectNavigation(Navigation, mode="perfect")``. Calling the
    class returns the variant that the values name.
    """

    #: of its keys, and the class that the group is entered with
    group: ClassVar[str] = ""
    root: ClassVar[type[Any] | None] = None

    def __init_subclass__(cls, *, group: str | None = None, only: Only | None = None, **tags: str) -> None:
        """Make a subclass a dataclass, and enter its keys among those that are known.

        Parameters
        ----------
        group : str, optional
            Such as ``optimizer.penalty``; empty for keys at the top of the configuration. A class without one
            is a variant, or holds what others share.
        only : Only, optional
            Where its keys exist, except for those that the condition is about.
        **tags : str
            Of a variant, the one value of each of its tags.
        """
        cls.__annotations__ |= {name: Literal[value] for name, value in tags.items()}
        for name, value in tags.items():
            setattr(cls, name, value)
        checked_dataclass(cls, config=CONFIG, frozen=True, kw_only=True)
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
            raise ValueError(no_group("{key}", value, cls))

        return core_schema.no_info_plain_validator_function(built)


def texts_of(kind: Any) -> dict[str, str]:
    """Return the texts that describe the fields of a class of settings: those below them, or given.

    pydantic's ``use_attribute_docstrings`` finds the same, but while classes are made, which every command
    would wait for: a millisecond a class.
    """
    texts: dict[str, str] = {}
    for owner in reversed(kind.__mro__[:-1]):
        given = getattr(owner, "__pydantic_fields__", {}).items()
        texts |= _texts_in(owner.__module__).get(owner.__qualname__, {})
        texts |= {name: entry.description for name, entry in given if entry.description}
    return {name: " ".join(text.split()) for name, text in texts.items()}


@cache
def _texts_in(module: str) -> Mapping[str, Mapping[str, str]]:
    """Return the texts below the fields of each class of a module, by the class's qualified name."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (KeyError, OSError, TypeError):  # it is there without its source
        return {}
    return dict(_texts_below(tree, ""))


def _texts_below(node: ast.Module | ast.ClassDef, prefix: str) -> Iterator[tuple[str, Mapping[str, str]]]:
    for inner in node.body:
        if isinstance(inner, ast.ClassDef):
            name = f"{prefix}{inner.name}"
            yield name, dict(_texts_of_fields(inner))
            yield from _texts_below(inner, f"{name}.")


def _texts_of_fields(node: ast.ClassDef) -> Iterator[tuple[str, str]]:
    for pair in pairwise(node.body):
        match pair:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                yield name, inspect.cleandoc(text)


#: fields that are not part of a configuration
NOT_CONFIGURED = ("mission", "resume")


def names_of(kind: Any) -> list[str]:
    """Return the keys of a group, without the group's name."""
    return [field.name for field in fields(kind) if field.name not in NOT_CONFIGURED]


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
            raise SettingError(f"{key} is {no_choice(value, choices)}")
        variants = [variant for variant in variants if value_of.get(variant, value) == value]
    return variants[0]


def conditions_of(kind: Any, name: str) -> Iterator[Only]:
    """Yield where a key exists, by the variants that have it: a condition for each tag that decides."""
    having = [variant for variant in variants_of(kind) if name in variant.__dataclass_fields__]
    for tag, value_of in tags_of(kind).items():
        values = list(dict.fromkeys(value_of[variant] for variant in having if variant in value_of))
        if tag != name and 0 < len(values) < len({*value_of.values()}):
            yield Only(*(f"{dotted(kind.group, (tag,))}={value}" for value in values))


#: pydantic's names for errors, to what a value must be
EXPECTED: Mapping[str, str] = {
    "greater_than": "greater than {gt}",
    "greater_than_equal": "at least {ge}",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "finite_number": "a finite number",
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "string_type": "a text",
    "string_pattern_mismatch": "of letters, digits, '_', '-' and '.' only",
    "tuple_type": "a list, [..., ...]",
    "dict_type": "a group of keys",
}


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
    key, value = dotted(kind.group, fault["loc"]), fault["input"]
    unit = in_unit(unit_of(key).symbol)
    match fault["type"]:
        case "unexpected_keyword_argument":
            words = _unexpected(kind, key)
        case "missing":
            words = f"the key {key} is missing; give it a value, {key}=..."
        case "dataclass_type":
            words = no_group(key, value, get_type_hints(kind)[str(fault["loc"][-1])])
        case "literal_error":
            choices = re.findall("'([^']*)'", fault["ctx"]["expected"])
            words = f"{key} is {no_choice(value, choices)}"
        case _ if cause is not None:
            words = str(cause).replace("{key}", key).replace("{unit}", unit)
        case name:
            limits = {limit: in_digits(number) for limit, number in fault.get("ctx", {}).items()}
            words = (
                f"{key} is {value!r}; it must be {EXPECTED[name].format(**limits)}{unit if limits else ''}"
            )
    return words


def no_group(key: str, value: Any, kind: Any) -> str:
    """Return a message about a value that is no group of keys, as a class of settings must have."""
    tags = [name for name, hint in get_type_hints(kind).items() if value in get_args(hint)]
    likely = f"; did you mean {key}.{tags[0]}={value}?" if tags else ""
    return f"{key} is {value!r}; it must be a group of keys: {', '.join(names_of(kind))}{likely}"


def _unexpected(kind: Any, key: str) -> str:
    """Return a message about a key that a class does not have: a variant's, or one that does not exist."""
    if kind.group == FREE:
        choices = choices_of(key.rpartition(".")[2], names_of(kind), "keys")
        return f"there is no key {key} with {FREE}.kind={kind.kind}{choices}"
    if key not in KNOWN:
        return unknown(key)
    where = " and ".join(map(str, conditions_of(kind.root, key.rpartition(".")[2])))
    return f"{key} counts only with {where}; set that, or leave {key} out"
