"""What opens and writes every file refuses links, pipes and devices, and uses names that nobody foresees."""

import os
import shutil
from pathlib import Path

import pytest

from fis_tools.edit.session import Session
from fis_tools.errors import ControllerFileError
from fis_tools.formats import serialize
from fis_tools.source import read_controller
from plain_files import file_access
from telemetry.commands import main as telemetry_main
from telemetry.file.partial_file import PARTIAL_SUFFIX
from tests.fis_tools.sample_controllers import PAPER_LIKE
from tests.smoke.file_calls import READERS, WRITERS
from tests.telemetry import synthetic_flight

SECRET = b"of somebody else"
#: how each writer is called that takes a path alone, or with a content
WRITES = {
    "replacing": lambda path: file_access.write_bytes(path, b"new"),
    "write_bytes": lambda path: file_access.write_bytes(path, b"new"),
    "write_text": lambda path: file_access.write_text(path, "new"),
    "create": lambda path: file_access.create(path).close(),
    "open_lock": lambda path: file_access.open_lock(path).close(),
}


@pytest.fixture
def secret(tmp_path) -> Path:
    (tmp_path / "secret").write_bytes(SECRET)
    return tmp_path / "secret"


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "file"


@pytest.mark.parametrize("reader", sorted(READERS))
def test_every_reader_opens_regular_files_alone(reader, path, secret):
    read = getattr(file_access, reader)
    for make, words in (
        (lambda: path.symlink_to(secret), "a link to"),
        (lambda: os.mkfifo(path), "a pipe"),
        (path.mkdir, "a folder"),
    ):
        make()
        with pytest.raises(OSError, match=words):  # at once: whoever opens a pipe waits for ever
            read(path)
        path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()
    with pytest.raises(OSError, match="a device"):
        read(Path("/dev/zero"))
    with pytest.raises(OSError, match="larger than 3 bytes"):
        read(secret, 3)


@pytest.mark.parametrize("writer", sorted(WRITERS - {"rename", "open_folder"}))
def test_no_writer_follows_a_link(writer, path, secret):
    path.symlink_to(secret)
    if writer == "create":  # takes the name from the link
        WRITES[writer](path)
        assert not path.is_symlink()
    else:
        with pytest.raises(OSError, match="link"):
            WRITES[writer](path)
        assert path.is_symlink()
    assert secret.read_bytes() == SECRET


def test_a_file_is_whole_or_as_it_was_and_grows_under_a_name_of_chance(path):
    path.write_bytes(SECRET)
    path.chmod(0o640)
    names = set()
    for _ in range(3):
        with pytest.raises(ZeroDivisionError), file_access.replacing(path) as stream:  # noqa: PT012
            stream.write(b"half")
            stream.flush()
            names |= set(os.listdir(path.parent)) - {path.name}
            raise ZeroDivisionError
    assert len(names) == 3
    assert os.listdir(path.parent) == [path.name]
    assert path.read_bytes() == SECRET
    file_access.write_bytes(path, b"new")
    assert (path.read_bytes(), path.stat().st_mode & 0o777) == (b"new", 0o640)


def test_links_at_names_that_can_be_foreseen_are_not_followed(tmp_path, secret):
    session, copy = Session(tmp_path / "sample.json", PAPER_LIKE), tmp_path / "sample-edited.yaml"
    for name in (f".{copy.name}.unfinished", f"{copy.name}.unfinished"):
        (tmp_path / name).symlink_to(secret)
    session.save(copy, replaces=True)
    copy.unlink()
    copy.symlink_to(secret)
    with pytest.raises(OSError, match="a link to"):
        session.save(copy, replaces=True)
    assert secret.read_bytes() == SECRET


def test_links_where_a_flight_is_rescued_or_exported_are_not_followed(tmp_path, secret, capsys):
    flight = synthetic_flight.record(synthetic_flight.fly(12), tmp_path / "flight.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(flight.read_bytes()[:-2000])
    rescued = tmp_path / "cut-recovered.mcap"
    for name in (rescued.name, cut.name):
        (tmp_path / f"{name}{PARTIAL_SUFFIX}").symlink_to(secret)
    telemetry_main(["recover", str(cut)])
    assert telemetry_main(["export", str(flight), "--format", "csv"]) == 0
    (folder,) = (part for part in tmp_path.iterdir() if part.is_dir())
    for part in folder.iterdir():
        part.unlink()
        part.symlink_to(secret)
    assert telemetry_main(["export", str(flight), "--format", "csv"]) == 2
    assert "a link to" in capsys.readouterr().err
    assert secret.read_bytes() == SECRET
    shutil.rmtree(folder)


@pytest.mark.parametrize("ending", ["", *serialize.ENDINGS])
def test_a_name_that_no_file_can_have_is_refused_as_one_that_is_not_there(ending):
    with pytest.raises(ControllerFileError, match=r"no such file|cannot be read"):
        read_controller("a" * 5000 + ending)


def test_a_folder_is_filled_whole_or_not_at_all(tmp_path) -> None:
    """What a killed program left there is no obstacle; any other file is."""
    (tmp_path / f".01234567{file_access.UNFINISHED}" / "evidence").mkdir(parents=True)
    with file_access.filling(tmp_path) as unfinished:
        (unfinished / "a.c").write_text("")
        assert list(tmp_path.glob("*.c")) == []
    assert [path.name for path in tmp_path.iterdir()] == ["a.c"]
    with pytest.raises(OSError, match="it is not empty"), file_access.filling(tmp_path):
        pass
