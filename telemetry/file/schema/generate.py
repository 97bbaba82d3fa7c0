"""Generate ``inspection_pb2.py`` and its type stub from ``inspection.proto``.

Run ``python -m telemetry.file.schema.generate`` after changing the ``.proto``; it needs grpcio-tools, a
development dependency. The generated files are committed, so users need no protobuf compiler.
"""

import sys
from pathlib import Path

from grpc_tools import protoc  # type: ignore[import-untyped]

SCHEMA_FOLDER = Path(__file__).parent
PROTO = "inspection.proto"


def generate(folder: Path) -> None:
    """Write the generated module and its type stub.

    Parameters
    ----------
    folder : Path
        An existing folder.

    Raises
    ------
    SystemExit
        If the compiler rejects the ``.proto``; it has printed why.
    """
    code = protoc.main(
        ["protoc", f"-I{SCHEMA_FOLDER}", f"--python_out={folder}", f"--pyi_out={folder}", PROTO]
    )
    if code != 0:
        sys.exit(code)


if __name__ == "__main__":
    generate(SCHEMA_FOLDER)
