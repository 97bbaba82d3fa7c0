"""Forged proofs: certificates with one thing changed, deleted, added, swapped or put twice."""

import json
import random
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, fields, replace
from functools import partial
from hashlib import sha256
from io import BytesIO
from itertools import combinations
from typing import Any, Final, get_args

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from fis_tools.model import FuzzyController, FuzzySystem, Rule, Variable, operators
from fis_tools.model.membership import SHAPES
from pipeline.flight.state.signals import CONSTANTS

THEOREM, CONTROLLER, TUBE = "theorem.json", "controller.json", "tube.parquet"
#: where a value stands in plain data: keys and indices from the top
Path = tuple[Any, ...]
#: the columns of a table, by their names
Columns = Mapping[str, Any]

#: every name of an operator, a method or a shape that the product knows
WORDS: Final = sorted(
    {
        word
        for kind in ("AndOperator", "OrOperator", "Defuzzifier", "Accumulation", "Aggregation", "Hedge")
        for word in get_args(getattr(operators, kind))
    }
    | set(SHAPES)
)
#: every key that files of ours may have, and one that none has
KEYS: Final = sorted(
    {
        field.name
        for kind in (FuzzyController, FuzzySystem, Variable, Rule, *SHAPES.values())
        for field in fields(kind)
    }
    | set(CONSTANTS)
    | {"range", "universe", "shape", "schema", "if", "then", "unheard_of"}
)
#: values that stand where others were, or under keys that were not there
ODD: Final = (
    0,
    1,
    -1.0,
    0.5,
    1e300,
    True,
    None,
    "",
    "0",
    "nan",
    "body",
    float("nan"),
    float("inf"),
    [],
    {},
    [0.0],
)
#: factors of numbers, from less than rounding in the proof to more than any room in it
FACTORS: Final = (-1.0, 0.0, 1.0 - 1e-12, 1.0 + 1e-12, 1.0 - 1e-6, 1.0 + 1e-6, 0.99, 1.01, 0.5, 2.0)


@dataclass(frozen=True)
class Change:
    """A change of a file: ``name`` says where it is, ``make`` returns the changed content."""

    name: str
    make: Callable[[], bytes]
    file: str = TUBE


@dataclass(frozen=True)
class Mutant:
    """A certificate with one change.

    Parameters
    ----------
    change : str
        What was done, and where.
    files : mapping of str to bytes
        Its files.
    """

    change: str
    files: Mapping[str, bytes]


def mutants(files: Mapping[str, bytes], number: int, seed: int) -> Iterator[Mutant]:
    """Yield mutants of a certificate: each place in its files is changed before one is changed again."""
    generator = random.Random(seed)  # noqa: S311
    changes: dict[str, list[Change]] = {}
    for name in (THEOREM, CONTROLLER):
        for change in changed_texts(json.loads(files[name])):
            changes.setdefault(f"{name}{change.name.partition(' ')[0]}", []).append(
                replace(change, file=name)
            )
    for change in changed_tables(files[TUBE], generator):
        changes.setdefault(change.name, []).append(change)
    for choices in changes.values():
        generator.shuffle(choices)
    choices_by_key = list(changes.values())
    generator.shuffle(choices_by_key)
    made = 0
    while choices_by_key:
        for choices in choices_by_key:
            change = choices.pop()
            content = {**files, change.file: change.make()}
            yield Mutant(f"{change.file}: {change.name}", restated(content))
            made += 1
            if made == number:
                return
        choices_by_key = [choices for choices in choices_by_key if choices]


def restated(files: Mapping[str, bytes]) -> Mapping[str, bytes]:
    """Return a certificate that states the hash of its controller, if it stated one."""
    text, digest = files[THEOREM].decode(), sha256(files[CONTROLLER]).hexdigest()
    stated = json.loads(text).get("controller_sha256") if text.startswith("{") else None
    if not isinstance(stated, str) or len(stated) != len(digest):
        return files
    return {**files, THEOREM: text.replace(stated, digest).encode()}


def changed_texts(document: Any) -> Iterator[Change]:
    """Yield changes of JSON; the name of each begins with the place and a blank."""
    for path, value in nodes(document):
        where = "".join(f".{step}" for step in path) or "."
        for new in changed_values(document, value):
            yield Change(f"{where} is {new!r}"[:120], partial(dumped, document, (path, new)))
        if path:
            yield Change(f"{where} deleted", partial(dumped, document, (path, DELETED)))
        if path and isinstance(path[-1], str):
            for new in ("unheard of", 0.0, value):
                name = f"{where} twice, first {new!r}"[:120]
                yield Change(name, partial(dumped, document, twice=(path, new)))
        if isinstance(value, dict):
            for key in (key for key in KEYS if key not in value):
                new = random.Random(key).choice((*WORDS, *ODD))  # noqa: S311
                yield Change(f"{where} has {key} {new!r}", partial(dumped, document, ((*path, key), new)))
            for first, second in combinations(value, 2):
                swap = ((*path, first), value[second]), ((*path, second), value[first])
                yield Change(f"{where} swaps {first} and {second}", partial(dumped, document, *swap))


def dumped(document: Any, *puts: tuple[Path, Any], twice: tuple[Path, Any] | None = None) -> bytes:
    """Return JSON of plain data with other values at some paths, or a key that stands twice."""
    for path, new in puts:
        document = put(document, path, new)
    return dump(document, twice).encode()


def changed_values(document: Any, value: Any) -> Iterator[Any]:
    """Yield what a value is changed to."""
    yield from ODD
    if isinstance(value, int | float) and not isinstance(value, bool):
        yield from (value * factor for factor in FACTORS)
        yield from (value + 1, value - 1, str(value), [value])
    elif isinstance(value, str):
        texts = sorted({text for _, text in nodes(document) if isinstance(text, str) and text != value})
        yield from random.Random(value).sample(texts, min(6, len(texts)))  # noqa: S311
        yield from (*WORDS, value.upper(), f"{value} ", f"{value}_2", [value])
    elif isinstance(value, list):
        yield from (value[1:], value[::-1], value[1:] + value[:1], value * 2, [*value, *value[-1:]])
        for first, other in combinations(range(len(value)), 2):
            swapped = list(value)
            swapped[first], swapped[other] = value[other], value[first]
            yield swapped
    elif isinstance(value, dict):
        yield list(value.values())


#: put under a key or at an index, it removes what is there
DELETED: Final = object()


def nodes(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield every value in plain data with its path."""
    yield path, value
    steps = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for step, part in steps:
        yield from nodes(part, (*path, step))


def put(document: Any, path: Path, new: Any) -> Any:
    """Return a copy of plain data with something else at a path."""
    if not path:
        return new
    copy = deepcopy(document)
    parent = copy
    for step in path[:-1]:
        parent = parent[step]
    if new is DELETED:
        del parent[path[-1]]
    else:
        parent[path[-1]] = new
    return copy


def dump(value: Any, twice: tuple[Path, Any] | None = None, path: Path = ()) -> str:
    """Write JSON in which a key may stand twice, first with another value."""
    if isinstance(value, dict):
        pairs = []
        for key, part in value.items():
            if twice is not None and twice[0] == (*path, key):
                pairs.append(f"{json.dumps(key)}: {json.dumps(twice[1])}")
            pairs.append(f"{json.dumps(key)}: {dump(part, twice, (*path, key))}")
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(dump(part, twice, (*path, index)) for index, part in enumerate(value)) + "]"
    return json.dumps(value)


#: shares of a box's width, and of a plane's numbers, by which numbers of a tube are changed
STEPS: Final = (-1.0, 1.0, -1e-3, 1e-3, -1e-6, 1e-6, 1e3)


def changed_tables(content: bytes, generator: random.Random) -> Iterator[Change]:
    """Yield changes of a table, in rows drawn by a generator."""
    table = pq.read_table(BytesIO(content))
    columns = {name: table[name].to_numpy() for name in table.column_names}
    for make in (changed_numbers, changed_columns, swapped_columns, changed_rows):
        for name, changed in make(columns, generator):
            yield Change(name, partial(packed, changed))


def changed_numbers(columns: Columns, generator: random.Random) -> Iterator[tuple[str, Columns]]:
    """Yield tables with another number in one row."""
    for name, column in columns.items():
        for step in STEPS:
            moved, row = column.copy(), generator.randrange(len(column))
            moved[row] += step * (abs(moved[row]) or 1.0)
            yield f"{name} changed by {step:g} of it", {**columns, name: moved}
        for odd in (np.nan, np.inf, -np.inf, 1e300, 0.0):
            moved = column.copy()
            moved[generator.randrange(len(column))] = odd
            yield f"{name} set to {odd}", {**columns, name: moved}


def changed_columns(columns: Columns, _: random.Random) -> Iterator[tuple[str, Columns]]:
    """Yield tables with another set of columns, or columns of another kind."""
    for name, column in columns.items():
        others = {key: columns[key] for key in columns if key != name}
        yield f"{name} left out", others
        yield f"{name} last", {**others, name: column}
        yield (
            f"{name} called otherwise",
            {f"{key}_2" if key == name else key: columns[key] for key in columns},
        )
        yield f"{name} as text", {**columns, name: column.astype(str)}
        yield f"{name} in single precision", {**columns, name: column.astype(np.float32)}
    yield "one more column", {**columns, "unheard_of": columns["step"]}


def swapped_columns(columns: Columns, generator: random.Random) -> Iterator[tuple[str, Columns]]:
    """Yield tables in which two columns change their names, or two numbers of a row their columns."""
    for first, second in combinations(columns, 2):
        yield f"{first} and {second} swapped", {**columns, first: columns[second], second: columns[first]}
        pair = {first: columns[first].copy(), second: columns[second].copy()}
        row = generator.randrange(len(columns[first]))
        pair[first][row], pair[second][row] = columns[second][row], columns[first][row]
        yield f"{first} and {second} of one box swapped", {**columns, **pair}


def changed_rows(columns: Columns, generator: random.Random) -> Iterator[tuple[str, Columns]]:
    """Yield tables without some rows, with some twice or without width, and in another order."""
    num_rows = len(columns["step"])
    order = np.arange(num_rows)
    for _ in range(10):
        row = generator.randrange(num_rows)
        yield "a box deleted", taken(columns, np.delete(order, row))
        yield "a box twice", taken(columns, np.append(order, row))
        yield "boxes in another order", taken(columns, np.random.default_rng(row).permutation(num_rows))
    for low, high in (("low_m", "high_m"), ("least_m_s", "greatest_m_s")):
        for digits in (1, 2, 8):
            row = generator.randrange(num_rows)
            ends = {name: columns[name].copy() for name in (low, high)}
            ends[low][row] = ends[high][row] = round(columns[low][row], digits)
            yield f"{low} and {high} equal, to {digits} digits", {**columns, **ends}
    yield "half of the boxes", taken(columns, order[: num_rows // 2])
    yield "no box", taken(columns, order[:0])


def taken(columns: Columns, rows: Any) -> Columns:
    """Return some rows of a table."""
    return {name: column[rows] for name, column in columns.items()}


def packed(columns: Columns) -> bytes:
    """Return columns as a file of Parquet."""
    sink = BytesIO()
    pq.write_table(pa.table(dict(columns)), sink)
    return sink.getvalue()
