"""What is written about the keys: the tables on the site, the help on a group, and comments in YAML.

All of it comes from the classes of settings: a key's meaning is the text below its field, and its range is in
the field's type.
"""

import ast
import inspect
import math
import sys
from collections.abc import Iterator, Mapping
from dataclasses import MISSING
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import yaml

from pipeline.settings.checks import MOST, expected
from pipeline.settings.controllers import PLANNED
from pipeline.settings.dispersions import IN_TIME
from pipeline.settings.groups import GROUPS, Only, names_of
from pipeline.settings.keys import FREE, unit_of
from pipeline.settings.mission import SHARED, Mission
from pipeline.settings.schema import Key, keys_of, schema


def tables() -> dict[str, list[Key]]:
    """Return the keys of each group, in the order of the page; "" for those at the top."""
    found: dict[str, list[Key]] = {"": []}
    for key in schema().values():
        found.setdefault(key.name.rpartition(".")[0], []).append(key)
    for name, kind in PLANNED.items():
        found[f"{FREE} ({name})"] = list(keys_of(FREE, kind))
    return found


def rows_of(group: str, keys: list[Key]) -> Iterator[tuple[str, str, str, str]]:
    """Yield the name, default, range and meaning of each key of a group."""
    for key in keys:
        name = key.name.rpartition(".")[2]
        default = "" if key.default is MISSING else f"`{as_yaml(key.default)}` {unit_of(name)}".strip()
        own = [mark for mark in key.only if not mark.is_of_stages and mark not in of_group(group)]
        meaning = descriptions().get(f"{group}.{name}".lstrip("."), "")
        only = f" Only with {in_code(own)}." if own else ""
        yield f"`{name}`{marks_of(key)}", default, range_of(key), meaning + only


def of_group(group: str) -> tuple[Only, ...]:
    """Return where the keys of a group exist."""
    return next((only for name, _, only in GROUPS if group and name == group), ())


def in_code(marks: list[Only]) -> str:
    """Return conditions in Markdown."""
    return " and ".join("`" + str(mark).replace(" or ", "` or `") + "`" for mark in marks)


def marks_of(key: Key) -> str:
    """Return whether a key may be dispersed, and vary in time."""
    top = key.name.partition(".")[0]
    if top not in names_of(Mission) or not isinstance(key.default, float) or key.name in SHARED:
        return ""
    return " **t**" if key.name in IN_TIME else " **d**"


def range_of(key: Key) -> str:
    """Return the values that a key may have."""
    kind, limits = _opened(key.hint)
    if get_origin(kind) is Literal:
        return ", ".join(f"`{value}`" for value in get_args(kind))
    if kind is bool:
        return "`true`, `false`"
    if kind not in (int, float):
        return ""
    low, high = limits.get("gt", limits.get("ge")), limits.get("lt", limits.get("le", math.inf))
    if kind is int and high >= MOST:
        high = math.inf
    is_open = low is None and high == math.inf
    words = (
        "greater than 0" if "gt" in limits and high == math.inf else "" if is_open else expected(low, high)
    )
    return ", ".join(filter(None, ("whole" if kind is int else "", words)))


def _opened(hint: Any) -> tuple[Any, dict[str, float]]:
    """Return the type within an annotation, None left out, and its limits."""
    limits: dict[str, float] = {}
    while True:
        if hasattr(hint, "__metadata__"):
            for mark in hint.__metadata__:
                for one in (mark, *getattr(mark, "metadata", ())):
                    for name in ("gt", "ge", "lt", "le"):
                        if getattr(one, name, None) is not None:
                            limits[name] = getattr(one, name)
            hint = hint.__origin__
        elif type(None) in get_args(hint):
            hint = next(one for one in get_args(hint) if one is not type(None))
        else:
            return hint, limits


def as_yaml(value: Any) -> str:
    """Return a value on one line, as YAML writes it."""
    text = yaml.safe_dump(value, default_flow_style=True, width=math.inf, allow_unicode=True)
    return text.removesuffix("\n").removesuffix("\n...")


def help_on(group: str) -> str:
    """Return the keys of a group, or one key, with defaults and meanings; nothing if there is none."""
    lines = []
    for name, keys in tables().items():
        found = [key for key in keys if f"{key.name}.".startswith(f"{group}.")]
        lines += [f"{name}: {descriptions()[name]}"] if found and name else []
        for key, (_, default, values, meaning) in zip(found, rows_of(name, found), strict=True):
            lines += [f"  {key.name}={default}", f"      {meaning}{f' ({values})' if values else ''}"]
    return "\n".join(lines).replace("`", "")


def commented(config: Mapping[str, Any]) -> str:
    """Return a configuration as YAML, with the meaning of each key above it."""
    return "\n".join(_commented(config, "", "")) + "\n"


def _commented(node: Mapping[str, Any], above: str, indent: str) -> Iterator[str]:
    for name, value in node.items():
        key = f"{above}{name}"
        is_group = isinstance(value, dict) and value and key not in schema()
        if meaning := descriptions().get(key):
            yield f"{indent}# {meaning}{f' ({unit})' if (unit := unit_of(key)) and not is_group else ''}"
        if is_group and key != FREE:
            yield f"{indent}{name}:"
            yield from _commented(value, f"{key}.", f"{indent}  ")
        elif key == FREE:
            text = yaml.safe_dump({name: value}, sort_keys=False, allow_unicode=True, width=110)
            yield from text.splitlines()
        else:
            yield f"{indent}{name}: {as_yaml(value)}"


@cache
def descriptions() -> dict[str, str]:
    """Return the meaning of each key, and of each group, from the sources of their classes."""
    texts: dict[str, str] = {}
    for group, kind, _ in GROUPS:
        prefix = f"{_group_of(group, kind)}." if group else ""
        texts[prefix.rstrip(".")] = (inspect.getdoc(kind) or "").partition("\n")[0]
        for owner in inspect.getmro(kind)[:-1]:
            for name, text in (
                _meanings(sys.modules[owner.__module__].__file__ or "").get(owner.__name__, {}).items()
            ):
                texts.setdefault(prefix + name, text)
    return texts


@cache
def _meanings(path: str) -> dict[str, dict[str, str]]:
    """Return the texts below the fields of each class in a source file."""
    tree = ast.parse(Path(path).read_text(encoding="utf-8"))
    found: dict[str, dict[str, str]] = {}
    for node in (node for node in tree.body if isinstance(node, ast.ClassDef)):
        for field, below in zip(node.body, node.body[1:], strict=False):
            is_text = isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
            if is_text and isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
                words = " ".join(str(below.value.value).split())  # type: ignore[attr-defined]
                found.setdefault(node.name, {})[field.target.id] = words
    return found


def _group_of(group: str, kind: Any) -> str:
    """Return the name of a group; controllers that plan have one each."""
    return next((f"{FREE} ({name})" for name, one in PLANNED.items() if one is kind), group)
