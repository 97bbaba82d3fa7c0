"""A proof's certificate as its checker reads it: every key and value that it models, and nothing else.

Whatever is not listed here is refused by its name, since a key that nobody reads may be one that a flight
obeys. Texts without effect, such as descriptions, may say anything.
"""

import hashlib
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.proof.strict import (
    Reader,
    count,
    exactly,
    items,
    mapping,
    name,
    number,
    numeral,
    parse,
    require,
    text,
    texts,
)
from plain_files.file_access import read_bytes

AXES: Final = (("x", "radial"), ("y", "along_track"), ("z", "cross_track"))
CORNERS: Final = ("left", "peak", "right")
MAX_JSON_BYTES: Final = 1024**2
MAX_TABLE_BYTES: Final = 64 * 1024**2
MAX_BOXES: Final = 500_000
#: states and forces are smaller than this, m, m/s, N
MAX_SIZE: Final = 1e4


class TubeBox(NamedTuple):
    """States along an axis after some periods, and the force there.

    Positions p and velocities v lie in ``low <= p <= high`` and ``least <= v + shear p <= greatest``; the
    force is ``constant + per_position p + per_velocity v``, give or take the residual.
    """

    step: float
    axis: float
    low: float
    high: float
    least: float
    greatest: float
    shear: float
    constant: float
    per_position: float
    per_velocity: float
    residual: float


#: the columns of a tube, in the order of a box's fields
COLUMNS: Final = (
    *("step", "axis", "low_m", "high_m", "least_m_s", "greatest_m_s", "shear_per_s"),
    *("constant_n", "per_position_n_m", "per_velocity_n_s_m", "residual_n"),
)


class ReceivedProof(NamedTuple):
    """A certificate, each part of which is read for itself; whether they fit together is checked later.

    Attributes
    ----------
    theorem : dict
        With the keys of `THEOREM`.
    systems : list of dict
        The systems that drive force_x, force_y and force_z, with the keys of `system`.
    dead_bands_n : list of float
        Of the same three.
    boxes : list of TubeBox
        Sorted.
    """

    theorem: dict[str, Any]
    systems: list[dict[str, Any]]
    dead_bands_n: list[float]
    boxes: list[TubeBox]


_state = items(number(-MAX_SIZE, MAX_SIZE), 6)
_any_size, _from_zero, _positive = number(-MAX_SIZE, MAX_SIZE), number(0.0, MAX_SIZE), number(1e-9, 1e6)
#: what is proved; with a negative slope a limit would not be least where the distance is
THEOREM = mapping(
    {
        "start_low": _state,
        "start_high": _state,
        "limit": lambda value, where: [
            read(item, f"{where}[{index}]")
            for index, (read, item) in enumerate(
                zip((_any_size, _from_zero, _any_size), items(_any_size, 3)(value, where), strict=True)
            )
        ],
        "goal": items(_from_zero, 2),
        "mean_motion_rad_s": number(1e-9, 1.0),
        "mass_kg": _positive,
        "period_s": number(1e-6, 1e4),
        "max_force_n": number(1e-9, MAX_SIZE),
        "num_periods": count(1, MAX_BOXES),
        "fault": exactly(""),
        "cells": items(count(1, 2000), 2),
        "controller_sha256": name,
    },
    {},
)


def variable(name_read: Reader, unit: str, num_terms: int, more: Mapping[str, Reader]) -> Reader:
    """Read a variable of triangles whose corners are points of its universe."""
    corner = number(-1e6, 1e6)
    term = mapping({"name": name, **dict.fromkeys(CORNERS, corner)}, {})
    keys = {
        "name": name_read,
        "unit": exactly(unit),
        "range": items(number(-1e5, 1e5), 2),
        "points": count(2, 100_000),
        "terms": items(term, num_terms, 64),
    }
    read = mapping({**keys, **more}, {"description": text})

    def read_variable(value: Any, where: str) -> dict[str, Any]:
        content = read(value, where)
        (low, high), terms = content["range"], content["terms"]
        require(high - low > 1e-6, f"{where}.range is empty")
        names = [term["name"] for term in terms]
        require(len(set(names)) == len(names), f"{where} has two terms of one name")
        for each in terms:
            require(
                each["left"] < each["peak"] < each["right"],
                f"{where}: the corners of {each['name']!r} do not ascend",
            )
        pieces = content["points"] - 1
        corners = [(each[key] - low) / (high - low) * pieces for each in terms for key in CORNERS]
        for position in corners:
            is_on_grid = not 0 <= position <= pieces or abs(position - round(position)) < 1e-9 * pieces
            require(is_on_grid, f"{where}: a corner off its grid")
        return {**content, "corners": corners}

    return read_variable


def system(axis: int) -> Reader:
    """Read the system that drives an axis: Mamdani's, by its position and velocity."""
    letter, along = AXES[axis]
    output = variable(exactly(f"force_{letter}"), "N", 2, {"default": number(-MAX_SIZE, MAX_SIZE)})

    def inputs(value: Any, where: str) -> list[dict[str, Any]]:
        position, velocity = items(lambda item, _: item, 2)(value, where)
        kinds = ((f"position_{along}", "m", position), (f"velocity_{along}", "m/s", velocity))
        return [
            variable(exactly(name), unit, 1, {})(item, f"{where}[{index}]")
            for index, (name, unit, item) in enumerate(kinds)
        ]

    keys = {
        "name": name,
        "and_operator": exactly("min"),
        "or_operator": exactly("max"),
        "defuzzifier": exactly("centroid"),
        "inputs": inputs,
        "outputs": items(output, 1),
        "rules": items(name, 1, 4096),
    }

    def read_system(value: Any, where: str) -> dict[str, Any]:
        content: dict[str, Any] = mapping(keys, {})(value, where)
        (force,) = content["outputs"]
        num_rules = math.prod(len(each["terms"]) for each in content["inputs"])
        require(len(content["rules"]) == num_rules, f"{where}.rules is no table of {num_rules} rules")
        names = {term["name"] for term in force["terms"]}
        for index, conclusion in enumerate(content["rules"]):
            require(conclusion in names, f"{where}.rules[{index}] is {conclusion!r}, no term of the output")
        # side by side and equal, so that each, cut, has its peak as its centroid
        corners, pieces = force["corners"], force["points"] - 1
        width = pieces / (2 * len(force["terms"]))
        for index, corner in enumerate(corners):
            even = width * (2 * (index // 3) + index % 3)
            require(abs(corner - even) < 1e-9 * pieces, f"{where}: uneven output terms")
        return content

    return read_system


def _driven(value: Any, where: str) -> int:
    """Return the axis that a system drives, which its only output names: a flight selects by it too."""
    require(isinstance(value, dict) and "outputs" in value, f"{where} has no outputs")
    (output,) = items(lambda item, _: item, 1)(value["outputs"], f"{where}.outputs")
    output_name = output.get("name") if isinstance(output, dict) else None
    names = [f"force_{letter}" for letter, _ in AXES]
    return names.index(exactly(*names)(output_name, f"{where}.outputs[0].name"))


def systems(value: Any, where: str) -> list[dict[str, Any]]:
    """Read three systems, in any order; return those that drive x, y and z."""
    by_axis: dict[int, dict[str, Any]] = {}
    for index, item in enumerate(items(lambda item, _: item, 3)(value, where)):
        axis = _driven(item, f"{where}[{index}]")
        require(axis not in by_axis, f"{where}[{index}] drives an axis that another system drives")
        by_axis[axis] = system(axis)(item, f"{where}[{index}]")
    require(len({each["name"] for each in by_axis.values()}) == 3, f"{where} has two systems of one name")
    return [by_axis[axis] for axis in range(3)]


#: the rules; a controller without other attributes decides in each control period
CONTROLLER = mapping(
    {
        "schema": exactly("fuzzy-controller"),
        "schema_version": exactly(1),
        "name": name,
        "attributes": mapping(
            {"force_axes": exactly("hill")}, {f"dead_band_force_{letter}_n": numeral for letter, _ in AXES}
        ),
        "provenance": texts,
        "systems": systems,
    },
    {"purpose": text},
)


def read_proof(folder: Path) -> ReceivedProof:
    """Read a certificate within seconds and a gigabyte, whatever its files hold.

    Raises
    ------
    ValueError
        If a key or a value is not modelled; the text names it.
    OSError
        If a file is missing, too large, a link, a pipe or a device.
    """
    theorem = THEOREM(parse(read_bytes(folder / "theorem.json", MAX_JSON_BYTES)), "theorem")
    for low, high in zip(theorem["start_low"], theorem["start_high"], strict=True):
        require(low <= high, "theorem.start_low is not below theorem.start_high")
    content = read_bytes(folder / "controller.json", MAX_JSON_BYTES)
    require(hashlib.sha256(content).hexdigest() == theorem["controller_sha256"], "another controller")
    controller = CONTROLLER(parse(content), "controller")
    bands = [controller["attributes"].get(f"dead_band_force_{letter}_n", 0.0) for letter, _ in AXES]
    boxes = _boxes(read_bytes(folder / "tube.parquet", MAX_TABLE_BYTES))
    return ReceivedProof(theorem, controller["systems"], bands, boxes)


def _boxes(content: bytes) -> list[TubeBox]:
    """Read a tube, whose description must fit before any of it is unpacked."""
    file = pq.ParquetFile(pa.BufferReader(content))
    described = file.metadata
    require(tuple(file.schema_arrow.names) == COLUMNS, f"the tube's columns are not {', '.join(COLUMNS)}")
    is_double = all(kind == pa.float64() for kind in file.schema_arrow.types)
    require(is_double, "the tube's columns are not all double")
    require(0 < described.num_rows <= MAX_BOXES, f"the tube has {described.num_rows} boxes")
    groups = [described.row_group(index) for index in range(described.num_row_groups)]
    unpacked = sum(group.total_byte_size for group in groups)
    require(unpacked <= MAX_TABLE_BYTES, f"the tube unpacks to {unpacked} bytes")
    table = file.read(use_threads=False)
    require(len(table) == described.num_rows, "the tube has other rows than it says")
    columns = [table[column].to_pylist() for column in COLUMNS]
    boxes = sorted(TubeBox(*row) for row in zip(*columns, strict=True) if _is_box(row))
    require(len(boxes) == len(table), "a number of the tube is missing or too large")
    for box in boxes:
        is_box = box.low <= box.high and box.least <= box.greatest and box.residual >= 0
        require(is_box, f"nothing lies between the ends of {box}")
    return boxes


def _is_box(row: tuple[Any, ...]) -> bool:
    """Return whether all numbers of a row are doubles of a reasonable size."""
    return all(isinstance(value, float) and abs(value) < MAX_SIZE for value in row)
