"""The forms in which the product infers: each takes systems with rows of inputs, and gives rows of outputs.

A form that refuses a system gives None for it.
"""

import ctypes
import json
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.errors import Mistake
from fis_tools.formats.c import source
from fis_tools.model import FuzzyController, FuzzySystem, Hedged, parts_of
from fis_tools.model.intervals import has_intervals
from fis_tools.review import carried, transcribed
from fis_tools.review import page as review_page
from plain_files.file_access import read_shipped
from tests.fis_tools import control_systems

#: A system and the inputs at which it is requested, (n, num_inputs).
Case = tuple[FuzzySystem, Floats]
Form = Callable[[Sequence[Case], Path], list[Floats | None]]

_DRIVER = """
const cases = JSON.parse(require("fs").readFileSync(0, "utf8"));
console.log(JSON.stringify(cases.map(({ system, rows }) => {
  const decoded = decodeSystem(system);
  return rows.map((row) => infer(decoded, row.map(Number)).outputs.map(({ value }) => String(value)));
})));
"""


def on_arrays(cases: Sequence[Case], folder: Path) -> list[Floats | None]:
    """Compiled, many samples at once."""
    return [compile(system)(rows) for system, rows in cases]


def one_by_one(cases: Sequence[Case], folder: Path) -> list[Floats | None]:
    """Compiled, a sample at a time."""
    answers: list[Floats | None] = []
    for system, rows in cases:
        infer = compile(system).prepare()
        answers.append(np.array([infer(*row) for row in rows.tolist()]))
    return answers


def as_c(cases: Sequence[Case], folder: Path) -> list[Floats | None]:
    """Written as C, and compiled by gcc with the flags that the file asks for."""
    texts: list[FuzzySystem] = []
    for number, (system, _) in enumerate(cases):
        named = replace(system, name=f"case {number}")
        try:
            source.write(FuzzyController("c", (named,)), bare=True)
        except (ValueError, Mistake):
            continue
        texts.append(named)
    if not texts:
        return [None] * len(cases)
    path = folder / "cases.c"
    path.write_text(source.write(FuzzyController("cases", tuple(texts)), bare=True), encoding="utf-8")
    library = path.with_suffix(f".{path.stat().st_mtime_ns}.so")  # a library that is loaded is not read anew
    command = ["gcc", *source.FLAGS.split(), "-shared", "-fPIC", str(path), "-o", str(library), "-lm"]
    subprocess.run(command, check=True, capture_output=True)  # noqa: S603
    loaded = ctypes.CDLL(str(library))
    names = {system.name for system in texts}
    return [
        _called(loaded, number, system, rows) if f"case {number}" in names else None
        for number, (system, rows) in enumerate(cases)
    ]


def _called(library: ctypes.CDLL, number: int, system: FuzzySystem, rows: Floats) -> Floats:
    """Answers of the C at rows, and then that it refuses NaN in each input, as all forms do."""
    pointer = ctypes.POINTER(ctypes.c_double)
    infer = getattr(library, f"infer_case_{number}")
    infer.restype = ctypes.c_double if len(system.outputs) == 1 else None

    def called(row: Floats) -> Floats:
        answer = np.empty(len(system.outputs))
        if len(answer) == 1:
            answer[0] = infer(row.ctypes.data_as(pointer))
        else:
            infer(row.ctypes.data_as(pointer), answer.ctypes.data_as(pointer))
        return answer

    rows = np.ascontiguousarray(rows)
    for index in range(rows.shape[1]):
        row = rows[0].copy()
        row[index] = np.nan
        if not np.isnan(answer := called(row)).all():
            raise ValueError(f"NaN in input {index + 1} is answered by {answer.tolist()}")
    return np.array([called(row) for row in rows])


def as_page(cases: Sequence[Case], folder: Path) -> list[Floats | None]:
    """The scripts of a review page, run by node; they take systems whose outputs are sets."""
    is_taken = [not (system.weighed or has_intervals(system)) for system, _ in cases]
    requested = {
        index: {
            "system": carried.system_data(system),
            "rows": [list(map(_written, row)) for row in rows.tolist()],
        }
        for index, (system, rows) in enumerate(cases)
        if is_taken[index]
    }
    inference = transcribed.script([each["system"] for each in requested.values()])
    scripts = Path(review_page.__file__).with_name("scripts")
    path = folder / "page.js"
    parts = (read_shipped(scripts / f"{name}.js") for name in ("systems", "inference"))
    path.write_text("\n".join([inference, *parts, _DRIVER]), "utf-8")
    command = ["node", str(path)]
    done = subprocess.run(  # noqa: S603
        command, input=json.dumps([*requested.values()]), check=True, capture_output=True, text=True
    )
    answers: list[Floats | None] = [None] * len(cases)
    for index, answer in zip(requested, json.loads(done.stdout), strict=True):
        shape = (len(cases[index][1]), len(cases[index][0].outputs))
        answers[index] = np.array(
            [[float(value.replace("Infinity", "inf")) for value in row] for row in answer]
        )
        answers[index] = np.reshape(answers[index], shape)
    return answers


def by_scikit_fuzzy(cases: Sequence[Case], folder: Path) -> list[Floats | None]:
    """scikit-fuzzy's own ``compute()``, for what it knows."""
    return [
        control_systems.by_scikit_fuzzy(system, rows) if _is_known(system) else None for system, rows in cases
    ]


def _is_known(system: FuzzySystem) -> bool:
    """Whether scikit-fuzzy has all that a system says: no hedges, no numbers, one way to cut and to join."""
    parts = [part for rule in system.rules for part in parts_of(rule.antecedent)]
    return (
        system.semantics == "scikit-fuzzy"
        and system.implication == "min"
        and not system.weighed
        and not any(isinstance(part, Hedged) for part in parts)
        and all(output.aggregation == "max" and output.default is not None for output in system.outputs)
    )


def _written(number: float) -> float | str:
    """A number as JavaScript's Number reads it; JSON has no infinity."""
    return number if np.isfinite(number) else ("Infinity" if number > 0 else "-Infinity")


FORMS: dict[str, Form] = {
    **{"arrays": on_arrays, "one by one": one_by_one, "C": as_c, "page": as_page},
    "scikit-fuzzy": by_scikit_fuzzy,
}
