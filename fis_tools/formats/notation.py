"""JSON and YAML text to plain data and back: strict when reading, laid out for people when writing.

Nothing is executed, and only what a controller needs is read. Plain scalars of YAML follow YAML 1.2: ``no``
and ``2026-01-01`` are words, ``1e-3`` is a number. Anchors, aliases, tags, merge keys and repeated keys are
refused. What is written reads the same under YAML 1.1.

Written YAML opens with ``---`` and closes with ``...``, and a file that has the one must have the other: this
is how a copy cut between two rules is told from a whole one.
"""

import json
import re
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import yaml
from yaml.composer import Composer

from fis_tools.errors import ControllerFileError

#: Levels of lists and mappings in a file.
MAX_DEPTH = 64
#: Bytes of a file; of JSON so many that every system that can be compiled can be read.
MAX_FILE_BYTES = 10 * 1024 * 1024
MAX_JSON_BYTES = 128 * 1024 * 1024
#: Without libyaml the reader is written in Python; this much takes it some seconds.
MAX_YAML_BYTES = 256 * 1024
#: Characters of a written line, where it can be kept.
LINE_WIDTH = 110


@contextmanager
def _refusing() -> Iterator[None]:
    """Turn errors that any notation may raise into refusals."""
    try:
        yield
    except ControllerFileError:
        raise
    except RecursionError as error:
        raise ControllerFileError(f"it is nested more than {MAX_DEPTH} deep; flatten it") from error
    except ValueError as error:
        raise ControllerFileError(f"a number is too long: {error}") from error


def is_scalar(value: object) -> bool:
    """Return whether a value is neither a list nor a mapping."""
    return value is None or isinstance(value, str | int | float)


def _inline(value: Any, scalar: Callable[[Any], str]) -> str:
    """Render plain data on one line, in JSON or YAML; `scalar` renders scalars."""
    if isinstance(value, Mapping):
        items = (f"{scalar(key)}: {_inline(item, scalar)}" for key, item in value.items())
        return "{" + ", ".join(items) + "}"
    if is_scalar(value):
        return scalar(value)
    return "[" + ", ".join(_inline(item, scalar) for item in value) + "]"


def rule_rows(system: Mapping[str, Any]) -> list[Sequence[str]]:
    """Split a system's rule table into rows, the last input's terms along each.

    Parameters
    ----------
    system : mapping
        Any mapping; only a fuzzy system whose `rules` are output terms has rows.

    Returns
    -------
    list
        The rows; empty where there is no rule table.
    """
    rules, inputs = system.get("rules"), system.get("inputs")
    if not rules or not inputs or not all(isinstance(rule, str) for rule in rules):
        return []
    width = len(inputs[-1]["terms"])
    return [rules[start : start + width] for start in range(0, len(rules), width)]


# JSON.


def read_json(text: str) -> Any:
    """Turn JSON into plain data, refusing what JSON leaves open: repeated keys, NaN, bottomless nesting.

    Raises
    ------
    ControllerFileError
        With a sentence.
    """
    with _refusing():
        try:
            return json.loads(text, object_pairs_hook=_unique_keys, parse_constant=_refuse_constant)
        except json.JSONDecodeError as error:
            if not text[error.pos :].strip():
                raise ControllerFileError(
                    f"the JSON ends in the middle of a value (line {error.lineno}); the file is cut short: "
                    "get a whole copy"
                ) from error
            raise ControllerFileError(
                f"it is not JSON: {error.msg} in line {error.lineno}, column {error.colno}; correct it there"
            ) from error


def write_json(mapping: Mapping[str, Any]) -> str:
    """Write plain data as JSON: short things on one line, rule tables in rows.

    Parameters
    ----------
    mapping : mapping
        Strings, finite floats, ints, lists and mappings.
    """
    return _block(mapping, 0) + "\n"


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object as a mapping; refuse repeated keys."""
    mapping = dict(pairs)
    if len(mapping) != len(pairs):
        times = Counter(key for key, _ in pairs)
        repeated = next(key for key, _ in pairs if times[key] > 1)
        raise ControllerFileError(f"the key {repeated!r} appears twice in one place; keep one of them")
    return mapping


def _refuse_constant(name: str) -> None:
    raise ControllerFileError(f"it contains {name}; every number must be finite")


def _json_scalar(value: Any) -> str:
    is_plain = not isinstance(value, str) or value.isprintable()
    return json.dumps(value, ensure_ascii=not is_plain, allow_nan=False)


def _block(value: Any, depth: int) -> str:
    """Return a value as JSON over several lines; short items stand on one."""
    inner, outer = "  " * (depth + 1), "  " * depth
    if isinstance(value, Mapping):
        rows = rule_rows(value)
        lines = [
            f"{inner}{_inline(key, _json_scalar)}: "
            + (_table(rows, depth + 1) if key == "rules" and rows else _fitted(item, depth + 1, len(key) + 4))
            for key, item in value.items()
        ]
        return "{\n" + ",\n".join(lines) + f"\n{outer}}}"
    return "[\n" + ",\n".join(inner + _fitted(item, depth + 1, 0) for item in value) + f"\n{outer}]"


def _fitted(value: Any, depth: int, used: int) -> str:
    is_short = _fits(value, 2 * depth + used, _json_scalar)
    return _inline(value, _json_scalar) if is_short else _block(value, depth)


def _table(rows: Sequence[Sequence[str]], depth: int) -> str:
    inner, outer = "  " * (depth + 1), "  " * depth
    lines = [inner + ", ".join(_inline(term, _json_scalar) for term in row) for row in rows]
    return "[\n" + ",\n".join(lines) + f"\n{outer}]"


# YAML.

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
            raise ControllerFileError(f"line {line} uses an anchor or alias (& or *); write the value out")
        if event.tag:
            raise ControllerFileError(f"line {line} has the tag {event.tag!r}; tags are not read: remove it")
        if self.depth >= MAX_DEPTH:
            raise ControllerFileError(f"line {line} is nested more than {MAX_DEPTH} deep; flatten it")
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
                raise ControllerFileError(f"line {line} has a list or mapping as a key; keys are words")
            key = str(key_node.value)
            if key in mapping:
                raise ControllerFileError(f"line {line} repeats the key {key!r}; keep one of them")
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


def _construct_float(loader: _Loader, node: yaml.ScalarNode) -> float:
    return float(re.sub(r"\.(?=[a-z])", "", loader.construct_scalar(node).lower()))


_Loader.add_constructor("tag:yaml.org,2002:int", lambda loader, node: int(loader.construct_scalar(node)))
_Loader.add_constructor("tag:yaml.org,2002:float", _construct_float)


def read_yaml(text: str) -> Any:
    """Turn a YAML document into plain data.

    Raises
    ------
    ControllerFileError
        With a sentence.
    """
    if len(text) > MAX_YAML_BYTES:
        raise ControllerFileError(f"it is longer than {MAX_YAML_BYTES} characters; keep so much data as JSON")
    with _refusing():
        try:
            loader = _Loader(text)
            data = loader.get_single_data()
        except yaml.MarkedYAMLError as error:
            raise ControllerFileError(_problem(error)) from error
        except (yaml.YAMLError, UnicodeEncodeError) as error:
            raise ControllerFileError(f"it is not YAML: {' '.join(str(error).split())}") from error
    if loader.is_opened and not loader.is_closed:
        raise ControllerFileError(
            "it opens with '---' but does not close with '...', so its end may be missing; get a whole copy, "
            "or add a last line '...' if it is whole"
        )
    return data


def _problem(error: yaml.MarkedYAMLError) -> str:
    """Return an error of YAML in our words: what, where, and the cure."""
    mark = error.problem_mark or error.context_mark
    problem = error.problem or error.context or "a mistake"
    if mark is None:
        return f"it is not YAML: {problem}; correct it"
    location = f"line {mark.line + 1}, column {mark.column + 1}"
    return (
        f"it is not YAML: {problem} in {location}; correct it there, or get a whole copy if the file is cut"
    )


def write_yaml(mapping: Mapping[str, Any]) -> str:
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
    """Return a character as a quoted text of YAML holds it."""
    if character in '"\\':
        return "\\" + character
    if character.isprintable():
        return character
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _yaml_scalar(value: Any) -> str:
    """Return a scalar in YAML; its reader takes a float without a point for a text."""
    if isinstance(value, str):
        return _string(value)
    text = json.dumps(value)
    return text.replace("e", ".0e") if isinstance(value, float) and "." not in text else text


def _mapping_lines(mapping: Mapping[str, Any], indent: int) -> list[str]:
    """Return a mapping as lines of YAML; short values stand beside their keys."""
    lines: list[str] = []
    rows = rule_rows(mapping)
    for key, value in mapping.items():
        head = " " * indent + _string(key) + ":"
        if key == "rules" and rows:
            lines += _table_lines(mapping, rows, indent)
        elif _fits(value, len(head) + 1):
            lines.append(f"{head} {_inline(value, _yaml_scalar)}")
        else:
            lines += [head, *_lines(value, indent + 2)]
    return lines


def _sequence_lines(items: Sequence[Any], indent: int) -> list[str]:
    """Return a list as lines of YAML."""
    lines: list[str] = []
    for item in items:
        if _fits(item, indent + 2):
            lines.append(" " * indent + "- " + _inline(item, _yaml_scalar))
        else:
            first, *rest = _lines(item, indent + 2)
            lines += [" " * indent + "- " + first.lstrip(), *rest]
    return lines


def _lines(value: Any, indent: int) -> list[str]:
    return _mapping_lines(value, indent) if isinstance(value, Mapping) else _sequence_lines(value, indent)


def _fits(value: Any, used: int, scalar: Callable[[Any], str] = _yaml_scalar) -> bool:
    """Return whether a value fits on one line after `used` characters; lists of mappings never do."""
    if is_scalar(value) or not value:
        return True
    if not isinstance(value, Mapping) and any(isinstance(item, Mapping) for item in value):
        return False
    return used + len(_inline(value, scalar)) <= LINE_WIDTH


def _table_lines(system: Mapping[str, Any], rows: Sequence[Sequence[str]], indent: int) -> list[str]:
    """Render a rule table, with comments that name the terms of its rows and columns."""
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
