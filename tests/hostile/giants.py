"""Files of up to 10 MB on which readers were slow or used much memory, generated again.

Each is for a reader of `tests.hostile.readers`, by its name.
"""

import io
import json
import zipfile
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from fis_tools.formats.serialize import FORMS

SIZE: Final = 10_000_000
#: readers of text in lines
LINES: Final = (
    *(name for name, form in FORMS.items() if form.is_read),
    "yaml",
    "conditions",
    "run",
    "starts",
    "requirements",
    "surroundings",
    "project",
)


def _filled(before: bytes, piece: bytes, after: bytes = b"") -> bytes:
    """Repeat a piece up to the largest allowed file size."""
    return before + piece * ((SIZE - len(before) - len(after)) // len(piece)) + after


def _sparse_archive() -> bytes:
    """Return an archive of a few megabytes with an array of 1 GB in it, like a checkpoint."""
    array, sink = io.BytesIO(), io.BytesIO()
    header = {"descr": "<f8", "fortran_order": False, "shape": (2**27,)}
    np.lib.format.write_array_header_1_0(array, header)
    with (
        zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("a.npy", "w") as entry,
    ):
        entry.write(array.getvalue())
        for _ in range(64):
            entry.write(bytes(2**24))
    return sink.getvalue()


def _repeated_numbers() -> bytes:
    """Return a table of less than a megabyte with a hundred million equal numbers in it."""
    sink = io.BytesIO()
    names = ("case", "sample", "position_x_m", "position_y_m", "position_z_m")
    part = pa.table({name: np.zeros(2**20) for name in names})
    with pq.ParquetWriter(sink, part.schema) as writer:
        for _ in range(20):
            writer.write_table(part)
    return sink.getvalue()


def _rules_of_a_missing_term(sample: bytes) -> bytes:
    tree = json.loads(sample)
    rules = tree["systems"][0]["rules"]
    tree["systems"][0]["rules"] = [json.loads(json.dumps(rules[0]).replace("IS ", "IS no"))] * 40_000
    return json.dumps(tree).encode()[:SIZE]


def _many_points(sample: bytes) -> bytes:
    tree = json.loads(sample)
    variable = tree["systems"][0]["inputs"][0]
    variable["terms"] *= 20_000 // len(variable["terms"])
    return json.dumps(tree).encode()[:SIZE]


#: reader, name, and function that makes the file from an intact one
GIANTS: Final[Mapping[tuple[str, str], Callable[[bytes], bytes]]] = {
    **{(reader, "digits and a letter"): lambda sample: _filled(sample, b"9", b"x")
       for reader in (*LINES, "json", "forces", "settings")},
    **{(reader, "lines again"): lambda sample: _filled(b"", sample + b"\n") for reader in LINES},
    **{(reader, "bottomless"): lambda _sample: _filled(b"", b"[")
       for reader in (*LINES, "json", "settings") if reader != "starts"},
    ("json", "keys again"): lambda _sample: _filled(b"{", b'"name":0,', b'"name":0}'),
    ("json", "rules of a missing term"): _rules_of_a_missing_term,
    ("json", "many terms"): _many_points,
    ("yaml", "flow lists"): lambda _sample: _filled(b"systems: [", b"[],", b"[]]"),
    ("run", "flow lists"): lambda _sample: _filled(b"systems: [", b"[],", b"[]]"),
    ("forces", "rows"): lambda sample: _filled(sample, b"1e3,0,0,0\n"),
    **{("fcl", name): lambda sample, piece=piece: _filled(sample, piece)
       for name, piece in {"remarks": b"(* *) ", "no ends": b"/* ", "lines of remarks": b"//\n",
                           "nested": b"RULE 1 : IF (((((("}.items()},
    ("conditions", "and"): lambda _sample: _filled(b"distance > 1", b" and distance > 1"),
    ("conditions", "not"): lambda _sample: _filled(b"", b"not ", b"distance > 1"),
    ("checkpoint", "sparse"): lambda _sample: _sparse_archive(),
    ("table", "repeated numbers"): lambda _sample: _repeated_numbers(),
    ("recording", "zeros"): lambda sample: sample[: len(sample) // 2] + bytes(SIZE - len(sample)),
    ("recording", "again"): lambda sample: _filled(b"", sample),
}  # fmt: skip
