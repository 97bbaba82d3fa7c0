"""YAML text to plain data and back: nothing is executed, and only what a controller needs is read.

Plain scalars follow YAML 1.2: ``no`` and ``2026-01-01`` are words, ``1e-3`` is a number. Anchors, aliases,
tags, merge keys and repeated keys are refused. What is written reads the same under YAML 1.1.

Written files open with ``---`` and close with ``...``, and a file that has the one must have the other: this
is how a copy cut between two rules is told from a whole one.
"""

import re
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import yaml
from yaml.composer import Composer

from fis_tools.formats.own.json import LINE_WIDTH, MAX_DEPTH, Unreadable, is_scalar, rule_rows

#: Without libyaml the reader is written in Python; this much takes it some seconds.
MAX_YAML_BYTES = 256 * 1024


#: libyaml tells what is in a text six times as fast as Python; it is put together and checked in Python
_BASES: tuple[Any, ...] = (Composer, yaml.CSafeLoader) if yaml.__with_libyaml__ else (yaml.SafeLoader,)


class _Loader(*_BASES):  # type: ignore[misc]
    """A safe loader without aliases, tags, repeated keys and bottomless nesting."""

    def __init__(self, text: str) -> None:
        _BASES[-1].__init__(self, text)
        self.anchors: dict[str, yaml.Node] = {}

    depth = 0
    is_opened = False
    is_closed = False

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()
        line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent) or event.anchor:
            raise Unreadable(f"line {line} uses an anchor or alias (& or *); write the value out")
        if event.tag:
            raise Unreadable(f"line {line} has the tag {event.tag!r}; tags are not read: remove it")
        if self.depth >= MAX_DEPTH:
            raise Unreadable(f"line {line} is nested more than {MAX_DEPTH} deep; flatten it")
        self.depth += 1
        node: yaml.Node | None = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def compose_document(self) -> yaml.Node | None:
        self.is_opened = self.get_event().explicit
        node = self.compose_node(None, 0)
        self.is_closed = self.get_event().explicit
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        mapping: dict[Hashable, Any] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            if not isinstance(key_node, yaml.ScalarNode):
                raise Unreadable(f"line {line} has a list or mapping as a key; keys are words")
            key = str(key_node.value)
            if key in mapping:
                raise Unreadable(f"line {line} repeats the key {key!r}; keep one of them")
            mapping[key] = self.construct_object(value_node, deep=True)
        return mapping


_RESOLVED = {
    "null": (r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    "bool": (r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    "int": (r"[-+]?[0-9]+", list("-+0123456789")),
    "float": (
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        list("-+.0123456789"),
    ),
}
_Loader.yaml_implicit_resolvers = {}
for _kind, (_pattern, _first) in _RESOLVED.items():
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_kind}", re.compile(rf"^(?:{_pattern})$"), _first)


def _construct_int(loader: _Loader, node: yaml.ScalarNode) -> int:
    return int(loader.construct_scalar(node))


def _construct_float(loader: _Loader, node: yaml.ScalarNode) -> float:
    return float(re.sub(r"\.(?=[a-z])", "", loader.construct_scalar(node).lower()))


_Loader.add_constructor("tag:yaml.org,2002:int", _construct_int)
_Loader.add_constructor("tag:yaml.org,2002:float", _construct_float)


def read(text: str) -> Any:
    """Turn a YAML document into plain data.

    Raises
    ------
    Unreadable
        With a sentence.
    """
    if len(text) > MAX_YAML_BYTES:
        raise Unreadable(f"it is longer than {MAX_YAML_BYTES} characters; keep so much data as JSON")
    try:
        loader = _Loader(text)
        data = loader.get_single_data()
    except yaml.MarkedYAMLError as error:
        raise Unreadable(_problem(error)) from error
    except (yaml.YAMLError, UnicodeEncodeError) as error:
        raise Unreadable(f"it is not YAML: {' '.join(str(error).split())}") from error
    except RecursionError as error:
        raise Unreadable(f"it is nested more than {MAX_DEPTH} deep; flatten it") from error
    except ValueError as error:
        raise (
            error if isinstance(error, Unreadable) else Unreadable(f"a number is too long: {error}")
        ) from error
    if loader.is_opened and not loader.is_closed:
        raise Unreadable(
            "it opens with '---' but does not close with '...', so its end may be missing; get a whole copy, "
            "or add a last line '...' if it is whole"
        )
    return data


def _problem(error: yaml.MarkedYAMLError) -> str:
    mark = error.problem_mark or error.context_mark
    problem = error.problem or error.context or "a mistake"
    if mark is None:
        return f"it is not YAML: {problem}; correct it"
    place = f"line {mark.line + 1}, column {mark.column + 1}"
    return f"it is not YAML: {problem} in {place}; correct it there, or get a whole copy if the file is cut"


def write(mapping: Mapping[str, Any]) -> str:
    """Write plain data as YAML: short things on one line, rule tables in rows.

    Parameters
    ----------
    mapping : mapping
        Strings, finite floats, ints, lists and mappings.
    """
    return "\n".join(["---", *_mapping_lines(mapping, 0), "..."]) + "\n"


# Words that some YAML reader takes for something else than a word.
_RESERVED = {"y", "n", "yes", "no", "on", "off", "true", "false", "null", "inf", "nan"}
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*( [A-Za-z0-9_(/][A-Za-z0-9_./()-]*)*")


def _string(text: str) -> str:
    if _PLAIN.fullmatch(text) and text.lower() not in _RESERVED:
        return text
    return '"' + "".join(_escaped(character) for character in text) + '"'


def _escaped(character: str) -> str:
    if character in '"\\':
        return "\\" + character
    if character.isprintable():
        return character
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _inline(value: Any) -> str:
    match value:
        case str():
            return _string(value)
        case None | bool():
            return {None: "null", True: "true", False: "false"}[value]
        case int():
            return str(value)
        case float():
            number = repr(value)
            return number if "." in number else number.replace("e", ".0e")
        case Mapping():
            return "{" + ", ".join(f"{_string(key)}: {_inline(item)}" for key, item in value.items()) + "}"
    return "[" + ", ".join(_inline(item) for item in value) + "]"


def _mapping_lines(mapping: Mapping[str, Any], indent: int) -> list[str]:
    lines: list[str] = []
    rows = rule_rows(mapping)
    for key, value in mapping.items():
        head = " " * indent + _string(key) + ":"
        if key == "rules" and rows:
            lines += _table_lines(mapping, rows, indent)
        elif _fits(value, len(head) + 1):
            lines.append(f"{head} {_inline(value)}")
        elif isinstance(value, Mapping):
            lines += [head, *_mapping_lines(value, indent + 2)]
        else:
            lines += [head, *_sequence_lines(value, indent + 2)]
    return lines


def _sequence_lines(items: Sequence[Any], indent: int) -> list[str]:
    lines: list[str] = []
    for item in items:
        if _fits(item, indent + 2):
            lines.append(" " * indent + "- " + _inline(item))
        elif isinstance(item, Mapping):
            first, *rest = _mapping_lines(item, indent + 2)
            lines += [" " * indent + "- " + first.lstrip(), *rest]
        else:
            first, *rest = _sequence_lines(item, indent + 2)
            lines += [" " * indent + "- " + first.lstrip(), *rest]
    return lines


def _fits(value: Any, used: int) -> bool:
    if is_scalar(value) or not value:
        return True
    if not isinstance(value, Mapping) and any(isinstance(item, Mapping) for item in value):
        return False
    return used + len(_inline(value)) <= LINE_WIDTH


def _table_lines(system: Mapping[str, Any], rows: Sequence[Sequence[str]], indent: int) -> list[str]:
    """Write a rule table, with the terms that belong to each row and column as comments."""
    *outer, last = system["inputs"]
    heads: list[list[str]] = [[]]
    for variable in outer:
        heads = [
            [*head, f"{variable['name']} {term['name']}"] for head in heads for term in variable["terms"]
        ]
    columns = ", ".join(term["name"] for term in last["terms"])
    width = max(len(_string(term)) for row in rows for term in row) + 2
    lines = [" " * indent + f"rules: [  # columns: {last['name']} {columns}"]
    for row, head in zip(rows, heads, strict=True):
        cells = "".join(f"{_string(term)},".ljust(width) for term in row)
        comment = f" # {', '.join(head)}" if head else ""
        lines.append(" " * (indent + 2) + f"{cells}{comment}".rstrip())
    return [*lines, " " * indent + "]"]
