"""Values of JSON, read strictly: a reader returns what a value means, or says where it is refused."""

import json
import re
from collections.abc import Callable, Mapping
from typing import Any, Final

#: reads a value, given where it stands
Reader = Callable[[Any, str], Any]
#: greatest size of a number that is written as text
MAX_NUMERAL: Final = 1e4


def require(holds: bool, fault: str) -> None:
    """Refuse the certificate, by a ValueError that says where it fails, unless something certainly holds."""
    if not holds:
        raise ValueError(fault)


def number(low: float, high: float) -> Reader:
    """Read a number from `low` to `high`."""

    def read(value: Any, where: str) -> float:
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        require(
            is_number and low <= value <= high, f"{where} is {shown(value)}, no number from {low} to {high}"
        )
        return float(value)

    return read


def count(low: int, high: int) -> Reader:
    """Read a whole number from `low` to `high`."""

    def read(value: Any, where: str) -> int:
        is_count = isinstance(value, int) and not isinstance(value, bool)
        require(
            is_count and low <= value <= high, f"{where} is {shown(value)}, no count from {low} to {high}"
        )
        return int(value)

    return read


def exactly(*values: Any) -> Reader:
    """Read one of some values."""

    def read(value: Any, where: str) -> Any:
        is_known = any(type(value) is type(known) and value == known for known in values)
        require(is_known, f"{where} is {shown(value)}, where {' or '.join(map(repr, values))} is modelled")
        return value

    return read


def text(value: Any, where: str) -> str:
    """Read a text."""
    require(isinstance(value, str), f"{where} is {shown(value)}, no text")
    return str(value)


def name(value: Any, where: str) -> str:
    """Read a name: printable, without blanks around it."""
    is_name = isinstance(value, str) and value and value.isprintable() and value == value.strip()
    require(bool(is_name), f"{where} is {shown(value)}, no name")
    return str(value)


def texts(value: Any, where: str) -> dict[str, str]:
    """Read a mapping of texts to texts."""
    require(isinstance(value, dict), f"{where} is {shown(value)}, no mapping")
    return {key: text(fact, f"{where}.{key}") for key, fact in value.items()}


def numeral(value: Any, where: str) -> float:
    """Read a number from 0 on that is written as text, as attributes are."""
    is_numeral = isinstance(value, str) and re.fullmatch(r"[0-9.]+(e[+-]?[0-9]+)?", value, re.ASCII)
    require(bool(is_numeral), f"{where} is {shown(value)}, no number from 0 on in quotation marks")
    return float(number(0.0, MAX_NUMERAL)(float(value), where))


def items(read: Reader, low: int, high: int | None = None) -> Reader:
    """Read a list of `low` to `high` items, or of exactly `low`."""
    high = low if high is None else high

    def read_list(value: Any, where: str) -> list[Any]:
        is_long = isinstance(value, list) and low <= len(value) <= high
        require(is_long, f"{where} is {shown(value)}, no list of {low} to {high} items")
        return [read(item, f"{where}[{index}]") for index, item in enumerate(value)]

    return read_list


def mapping(required: Mapping[str, Reader], optional: Mapping[str, Reader]) -> Reader:
    """Read a mapping with some keys and no others."""

    def read(value: Any, where: str) -> dict[str, Any]:
        require(isinstance(value, dict), f"{where} is {shown(value)}, no mapping")
        for key in value:
            require(key in required or key in optional, f"{where} has the key {key!r}, which is not modelled")
        for key in required:
            require(key in value, f"{where} lacks the key {key!r}")
        readers = {**required, **optional}
        return {key: readers[key](item, f"{where}.{key}") for key, item in value.items()}

    return read


def shown(value: Any) -> str:
    """Return the beginning of a value, for a sentence."""
    return repr(value)[:60]


def parse(content: bytes) -> Any:
    """Parse JSON, refusing keys that stand twice, of which readers take either, and what is no number."""

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        keys = dict(pairs)
        require(len(keys) == len(pairs), f"a key stands twice among {shown([key for key, _ in pairs])}")
        return keys

    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is no number")

    try:
        return json.loads(content.decode("utf-8"), object_pairs_hook=unique, parse_constant=refuse)
    except RecursionError as error:
        raise ValueError("the JSON is nested too deep") from error
