"""Windows whose changes outlast their pages, the names of their copies, and how these are written."""

import os
import signal
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from uvicorn import Config

from fis_tools.edit.server import Server, serve
from fis_tools.edit.session import Session
from fis_tools.edit.windows import Windows
from fis_tools.errors import Mistake
from tests.fis_tools.sample_controllers import PAPER_LIKE


@dataclass
class Tab:
    """A page in a browser, as far as windows know."""

    has_socket_connection: bool = True


def renamed(controller):
    return replace(controller, purpose="Another.")


def test_a_page_has_its_window_again_and_a_closed_one_is_offered() -> None:
    windows = Windows(lambda: Session(Path("sample.yaml"), PAPER_LIKE))
    tab = Tab()
    name = windows.connect("", tab)
    assert windows.num_unsaved == 0
    windows[name].touch(renamed)
    assert windows.connect(name, tab) == name
    other = windows.connect("unheard-of", Tab())
    assert other not in (name, "unheard-of")
    assert windows[other].controller == PAPER_LIKE
    assert (windows.num_unsaved, windows.abandoned()) == (1, "")
    tab.has_socket_connection = False
    assert windows.abandoned() == name
    windows[name].step(-1)
    assert windows.abandoned() == ""


@pytest.mark.parametrize(
    "name",
    ["/etc/abs", "../../x", "..", "", "a/b", "x" * 400, "\u00e9" * 400, "a\nb\x1b[2J", "a\x00b", "-rf *"],
)
def test_a_proposed_name_stays_in_the_folder_and_can_be_written(name, tmp_path) -> None:
    session = Session(tmp_path / "sample.yaml", replace(PAPER_LIKE, name=name))
    proposed = session.proposed()
    assert proposed.parent == tmp_path
    assert all(letter.isprintable() and letter not in "/\\" for letter in proposed.name)
    proposed.touch()
    assert session.proposed() != proposed
    assert os.listdir(tmp_path) == [proposed.name]


def test_a_copy_is_on_disk_with_its_folder_before_it_counts_as_saved(tmp_path, monkeypatch) -> None:
    session = Session(tmp_path / "sample.yaml", PAPER_LIKE)
    session.touch(renamed)
    synced, sync = [], os.fsync

    def record(descriptor: int) -> None:
        synced.append((Path(os.readlink(f"/proc/self/fd/{descriptor}")), session.is_unsaved))
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", record)
    session.save(tmp_path / "copy.yaml", replaces=False)
    assert [(path.parent, is_unsaved) for path, is_unsaved in synced[:-1]] == [(tmp_path, True)]
    assert synced[-1] == (tmp_path, True)
    assert not session.is_unsaved


def test_what_cannot_be_edited_is_refused_before_anything_is_served() -> None:
    def refused() -> Session:
        raise Mistake("nobody edits this")

    with pytest.raises(Mistake, match="nobody edits this"):
        serve(refused, lambda _: None, "tipper", opens=False)


def test_the_first_interrupt_warns_of_changes_that_are_not_saved(capsys) -> None:
    windows = Windows(lambda: Session(Path("sample.yaml"), PAPER_LIKE))
    windows[windows.connect("", Tab())].touch(renamed)

    def ended_by(*signals: int) -> bool:
        server = Server(Config(lambda: None), windows)
        for number in signals:
            server.handle_exit(number, None)
        return server.should_exit

    assert not ended_by(signal.SIGINT)
    assert capsys.readouterr().err.startswith("changes in 1 window are not saved")
    assert ended_by(signal.SIGINT, signal.SIGINT)
    assert ended_by(signal.SIGTERM)


def test_no_copy_follows_a_link(tmp_path) -> None:
    (tmp_path / "kept.yaml").write_text("kept")
    (tmp_path / "copy.yaml").symlink_to(tmp_path / "kept.yaml")
    session = Session(tmp_path / "sample.yaml", PAPER_LIKE)
    with pytest.raises(OSError, match="a link to"):
        session.save(tmp_path / "copy.yaml", replaces=True)
    assert (tmp_path / "kept.yaml").read_text() == "kept"
