"""Whether functions of Python do the same to an array as their translations to C, bit for bit."""

import ctypes
import inspect
import re
import subprocess
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fis_tools.compiled.decorator import plainly
from fis_tools.compiled.dispatchers import FromPython
from fis_tools.formats.c.text import table
from pipeline.onboard.allowed import TranslationError
from pipeline.onboard.arrays import Array
from pipeline.onboard.operations import OPERATIONS
from pipeline.onboard.translator import Translator
from pipeline.onboard.values import Expression
from pipeline.onboard.writer import Setting
from plain_files.document.html import read

#: cells of the array that a function works on, and the numbers that it is given with it
NUM_CELLS = 8
XS = (-1.5, -0.0, 0.0, 0.3, 1.0, 1.7, 2.5, 5.0, 1e300, float("inf"), float("nan"))
FLAGS = ("-std=c99", "-O1", "-ffp-contract=off", "-Werror", "-fPIC", "-shared")


@dataclass
class Agreement:
    """What became of functions, by name: refused and why, different and where, and the same.

    A function that Python itself cannot run on any number is the same nowhere, and listed apart.
    """

    refused: dict[str, str] = field(default_factory=dict)
    different: dict[str, str] = field(default_factory=dict)
    same: list[str] = field(default_factory=list)
    without_result: list[str] = field(default_factory=list)


def translated(function: Any, name: str, bounds: Mapping[Any, Any] | None = None) -> str:
    """Return a function of an array and a number as C, under a name; nothing is left to an analyser."""
    translator = Translator(Setting(OPERATIONS, bounds=bounds or {}))
    arguments = {"cells": Array("state->cells", (NUM_CELLS,)), "x": Expression("x", is_name=True)}
    translator.write("entry", function, arguments)
    text = "".join(
        f"static {each.signature} {{\n{chr(10).join(line.text for line in each.lines)}\n}}\n"
        for each in translator.functions
    )
    for each in translator.functions:
        text = re.sub(rf"\b{each.name}\(", f"{name}_{each.name}(", text)
    for array in translator.tables.values():
        text = re.sub(rf"(?<![\w>.]){array.name}\[", f"{name}_{array.name}[", text)
        text = f"{table(array.kind, f'{name}_{array.name}', array.data.tolist())}\n{text}"
    return text.replace(f"static void {name}_entry(", f"void {name}_entry(")


def entries(texts: Mapping[str, str], folder: Path, compiler: str) -> dict[str, Callable[..., Any]]:
    """Return translated functions, compiled; a name that C does not compile is told by the exception."""
    helpers = read("templates/helpers.c", "pipeline.onboard").replace("static ", "static inline ")
    opening = f"#include <stdbool.h>\n#include <math.h>\n{helpers}"
    opening += f"struct controller {{ double cells[{NUM_CELLS}]; }};\n"
    source, target = folder / "functions.c", folder / "functions.so"
    source.write_text(opening + "".join(texts.values()))
    subprocess.run([compiler, *FLAGS, "-o", target, source, "-lm"], check=True)  # noqa: S603
    loaded = ctypes.CDLL(str(target))
    return {name: getattr(loaded, f"{name}_entry") for name in texts}


def alike(first: Any, second: Any) -> Any:
    """Return which numbers have the same bits, or are both NaN."""
    return (first.view(np.int64) == second.view(np.int64)) | (np.isnan(first) & np.isnan(second))


def is_open(function: Any) -> bool:
    """Return whether NumPy leaves open what a function does: which of two zeros its maximum is."""
    return ".max()" in inspect.getsource(function.py_func)


def flies_alike(function: Any, x: float, by_c: Any) -> bool:
    """Return whether a function as it flies, compiled, does the same as C, bit for bit."""
    flown = np.arange(NUM_CELLS) * 0.5
    FromPython(function.py_func, targetoptions={"nopython": True, **function.targetoptions})(flown, x)
    return bool(alike(flown, by_c).all())


def difference(function: Any, entry: Callable[..., Any]) -> str | None:
    """Return where C and Python differ first; "" if nowhere, None if Python has no result for any number."""
    is_run = False
    for x in XS:
        by_python, by_c = np.arange(NUM_CELLS) * 0.5, np.arange(NUM_CELLS) * 0.5
        try:
            with plainly(function.__module__.partition(".")[0]):
                function.py_func(by_python, x)
        except (ArithmeticError, ValueError, IndexError):  # such as division by zero
            continue
        except TypeError as error:
            # NumPy refuses to change the sign of its conditions, and to keep it
            if not {"boolean", "BoolDType"} & set(re.findall(r"\w+", str(error))):
                raise
            continue
        is_run = True
        entry(ctypes.c_void_p(by_c.ctypes.data), ctypes.c_double(x))
        is_same = alike(by_python, by_c)
        is_left = is_open(function) and np.array_equal(by_python, by_c, equal_nan=True)
        if not is_same.all() and not (is_left and flies_alike(function, x, by_c)):
            cell = int(np.flatnonzero(~is_same)[0])
            return f"x={x}: cell {cell} is {by_python[cell]!r} by Python, {by_c[cell]!r} by C"
    return "" if is_run else None


def compared(functions: Iterable[Any], folder: Path, compiler: str, bounds: Any = None) -> Agreement:
    """Return what becomes of functions of an array and a number."""
    agreement, texts, by_name = Agreement(), dict[str, str](), {}
    for function in functions:
        by_name[function.__name__] = function
        try:
            texts[function.__name__] = translated(function, function.__name__, bounds)
        except TranslationError as error:
            agreement.refused[function.__name__] = str(error)
    for name, entry in entries(texts, folder, compiler).items():
        where = difference(by_name[name], entry)
        if where is None:
            agreement.without_result.append(name)
        elif where:
            agreement.different[name] = where
        else:
            agreement.same.append(name)
    return agreement
