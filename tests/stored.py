"""Results as readable text, to be stored beside a test and compared: pages, figures, folders, any values.

Numbers have six significant digits, so that files are the same on every machine.
"""

import base64
import contextlib
import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from html.parser import HTMLParser
from itertools import groupby

import numpy as np
import pyarrow.parquet as pq
import yaml

#: below this a number is what is left of a difference
NOTHING = 1e-12
#: longer arrays are told by their ends and means
MOST_VALUES = 12
#: of longer lists of other things the first and the last are told
MOST_PARTS = 30
_NUMBER = re.compile(r"(?<![\w.])-?\d+\.\d{3,}(?:e[+-]?\d+)?(?![\w.])|-?\d(?:\.\d+)?e[+-]\d+")
_PACKED = re.compile(r"[A-Za-z0-9+/]{16,}={0,2}")
_INDENT = "  "


def number(value):
    """A number with six significant digits; what is almost nothing is 0."""
    value = float(value)
    return "0" if abs(value) < NOTHING else f"{value:.6g}"


def rounded(text):
    """A text with its numbers rounded."""
    return _NUMBER.sub(lambda match: number(match[0]), text)


def array(values):
    """An array: its shape, and its values or, of many, both ends and means, also weighted by their order."""
    values = np.asarray(values)
    if values.dtype.kind not in "biuf":
        runs = [(name, len(list(alike))) for name, alike in groupby(map(str, values.ravel()))]
        shown = [f"{name} x {count}" if count > 1 else name for name, count in runs[:MOST_VALUES]]
        return f"{values.shape} {', '.join(shown)}" + (
            f" ... of {len(runs)}" if len(runs) > MOST_VALUES else ""
        )
    numbers = values.ravel().astype(float)
    if len(numbers) <= MOST_VALUES:
        return f"{values.shape} {' '.join(map(number, numbers))}"
    finite = np.where(np.isfinite(numbers), numbers, 0.0)
    ends = f"{' '.join(map(number, numbers[:4]))} ... {' '.join(map(number, numbers[-3:]))}"
    later = np.mean(finite * np.linspace(0.0, 1.0, len(finite)))
    means = f"mean {number(finite.mean())}, weighted {number(later)}"
    return f"{values.shape} {ends}; {means}"


def _unpacked(text):
    """What a page carries as text, as an array."""
    raw = base64.b64decode(text)
    if len(raw) % 4 == 0:
        values = np.frombuffer(raw, "<f4").astype(float)
        if np.all(np.isfinite(values)) and np.all((values == 0.0) | (np.abs(np.abs(values) - 1e5) < 1e5)):
            return f"floats {array(values)}"
    return f"bytes {array(np.frombuffer(raw, np.uint8))}"


def lines_of(value, leave_out=()):
    """Yield a value in lines: dictionaries, data classes and lists with one item a line, arrays in one."""
    if is_dataclass(value) and not isinstance(value, type):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        for name, part in value.items():
            if name not in leave_out:
                yield from _entry(f"{name}:", part, leave_out)
    elif isinstance(value, list | tuple | set | frozenset):
        parts = sorted(value) if isinstance(value, set | frozenset) else list(value)
        if (numbers := _as_numbers(parts)) is not None:
            yield array(numbers)
            return
        for number, part in enumerate(parts):
            if len(parts) <= MOST_PARTS or number < 3 or number == len(parts) - 1:
                yield from _entry("-", part, leave_out)
        if len(parts) > MOST_PARTS:
            yield f"of {len(parts)}"
    else:
        yield from _plain(value)


def _as_numbers(parts):
    """Nested lists of numbers as an array; None if they are none."""
    with contextlib.suppress(ValueError):
        numbers = np.array(parts)
        return numbers if numbers.size and numbers.dtype.kind in "biuf" else None
    return None


def _plain(value):
    if isinstance(value, np.ndarray) and value.ndim:
        return [array(value)]
    if isinstance(value, float | np.floating):
        return [number(value)]
    if isinstance(value, str) and _PACKED.fullmatch(value) and len(value) % 4 == 0:
        return [_unpacked(value)]
    return rounded(str(value)).splitlines() or [""]


def _entry(head, part, leave_out):
    lines = list(lines_of(part, leave_out))
    if len(lines) == 1 and not isinstance(part, dict):
        yield f"{head} {lines[0]}".rstrip()
    else:
        yield head
        yield from (_INDENT + line for line in lines)


def text_of(value, leave_out=()):
    """A value as text."""
    return "\n".join(lines_of(value, leave_out)) + "\n"


class _Tags(HTMLParser):
    """A page, one tag a line, without scripts and styles."""

    SKIPPED = ("script", "style", "noscript")

    def __init__(self):
        super().__init__(convert_charrefs=True)
        self.lines, self._skipped = [], 0

    def handle_starttag(self, tag, attrs):
        if tag in self.SKIPPED:
            self._skipped += 1
        elif not self._skipped and tag != "meta":
            words = "".join(
                f' {name}="{rounded(value or "")}"' for name, value in attrs if name != "integrity"
            )
            self.lines.append(f"<{tag}{words}>")

    def handle_endtag(self, tag):
        if tag in self.SKIPPED:
            self._skipped -= 1

    def handle_data(self, data):
        words = rounded(" ".join(data.split()))
        if self._skipped or not words:
            return
        if self.lines and self.lines[-1].endswith(">"):
            self.lines[-1] += f" {words}"
        else:
            self.lines.append(words)


def page(text):
    """A page of HTML without scripts, styles and policies, one tag a line."""
    tags = _Tags()
    tags.feed(str(text))
    return "\n".join(tags.lines) + "\n"


def table(path):
    """The columns of a table, by name."""
    columns = pq.read_table(path)
    return {
        name: column.to_numpy(zero_copy_only=False)
        for name, column in zip(columns.column_names, columns.columns, strict=True)
    }


def folder(top, leave_out=()):
    """The files of a folder with their content, but for those whose names match a pattern."""
    parts = []
    for path in sorted(top.rglob("*")):
        name = str(path.relative_to(top))
        if path.is_dir():
            continue
        if any(re.search(pattern, name) for pattern in leave_out):
            parts.append(f"== {name}\n")
        elif path.suffix == ".parquet":
            parts.append(f"== {name}\n{text_of(table(path))}")
        elif path.suffix == ".json":
            parts.append(f"== {name}\n{text_of(yaml.safe_load(path.read_text(encoding='utf-8')))}")
        elif path.suffix == ".html":
            parts.append(f"== {name}\n{page(path.read_text(encoding='utf-8'))}")
        elif path.suffix in (".csv", ".yaml", ".txt"):
            lines = rounded(path.read_text(encoding="utf-8")).splitlines()
            more = [f"... of {len(lines)}", lines[-1]] if len(lines) > MOST_VALUES else []
            parts.append("\n".join([f"== {name}", *lines[:MOST_VALUES], *more, ""]))
        else:
            parts.append(f"== {name}\n")
    return "".join(parts)
