"""How flights laid over each other are told apart."""

from pathlib import Path
from types import MappingProxyType

import pytest

from telemetry.file.reader import Recording
from telemetry.scene.curves import flight_names


def recordings(*paths: str) -> list[Recording]:
    empty = MappingProxyType({})
    return [Recording(path=Path(path), topics=empty, metadata=empty, attachments=empty) for path in paths]


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["/a/x.mcap"], ["x"]),
        (["/a/x.mcap", "/a/y.mcap"], ["x", "y"]),
        (["/a/x.mcap", "/b/x.mcap"], ["a/x", "b/x"]),
        # the folder in common tells nothing
        (["/a/episodes/x.mcap", "/b/episodes/x.mcap", "/b/episodes/y.mcap"], ["a/x", "b/x", "y"]),
        (["/a/x.mcap", "/a/x.mcap"], ["x 1", "x 2"]),
    ],
)
def test_names_are_short_and_differ(paths: list[str], names: list[str]) -> None:
    assert flight_names(recordings(*paths)) == names
