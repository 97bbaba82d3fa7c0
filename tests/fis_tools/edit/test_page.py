"""The editor in a browser: drag, click, type, undo, save, and what is refused."""

import http.client
import re
import shutil
import socket
import stat
import time
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Locator, Page, expect

from fis_tools.findings.difference import difference
from fis_tools.formats import serialize
from fis_tools.source import read_controller
from tests.browser import serious_violations
from tests.editors import served
from tests.places import PROJECT
from tests.programs import run_python

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("edited")
    shutil.copy(PROJECT / "conf/controller/champion_27.yaml", folder)
    return folder


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    with served("fis_tools", "edit", "champion_27.yaml", folder=folder) as address:
        yield address


@pytest.fixture
def page(open_page, address) -> Page:
    return open_page(address)


def save(page: Page, name: str = "") -> None:
    """Save a copy, under a name if one is given."""
    page.get_by_role("button", name="Save a copy").click()
    if name:
        page.get_by_label("file", exact=True).fill(name)
    page.get_by_role("button", name="Save", exact=True).click()


def entered(field: Locator, words: str) -> None:
    field.fill(words)
    field.press("Enter")


def status(page: Page) -> Locator:
    return page.get_by_role("status").first


def conclusion(page: Page, rule: int) -> str:
    return page.get_by_label(f"rule {rule}:").inner_text().replace("\u200b", "")


def handle(page: Page, name: str) -> float:
    return float(page.get_by_role("slider", name=name).first.input_value())


def test_what_a_hand_changes_is_what_a_copy_holds(page, open_page, folder) -> None:
    knob = page.get_by_role("slider", name="positive_small, peak")
    knob.scroll_into_view_if_needed()
    box, plot = knob.bounding_box(), page.locator(".plot").last.bounding_box()
    x, y = plot["x"] + plot["width"] * (0.22 + 0.11) / 0.44, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + plot["width"] / 8, y, steps=5)
    page.mouse.up()
    expect(page.get_by_text("1 term changed")).to_be_visible()
    expect(knob).to_have_value(re.compile(r"^0\.16"))  # 0.11 and an eighth of the range of 0.44 N
    dragged = handle(page, "positive_small, peak")
    page.get_by_label("rule 2:").click()
    expect(page.get_by_label("rule 2:")).to_contain_text("zero")
    page.get_by_label("rule 3:").click()
    expect(page.get_by_text("2 of 9 rules changed")).to_be_visible()
    page.get_by_role("button", name="Undo").click()
    expect(page.get_by_text("1 of 9 rules changed")).to_be_visible()
    assert handle(page, "positive_small, peak") == dragged

    save(page)
    expect(status(page)).to_contain_text("wrote")
    copy = read_controller(folder / "champion_27-edited.yaml")
    original = read_controller(folder / "champion_27.yaml")
    (system,) = (entry for entry in difference(original, copy).systems if not entry.is_empty)
    assert [(entry.number, entry.after.consequents[0].term) for entry in system.rules] == [(2, "zero")]
    assert copy.systems[0].outputs[0].terms[3].membership.peak == dragged
    facts = dict(copy.provenance)
    changes = "force_x: 1 term changed; 1 of 9 rules"
    assert facts["edited_from"].startswith(f"{serialize.fingerprint(original)}: {changes}")
    assert "then force_x is negative_small → If" in facts["edited_from"]
    assert "by hand after training" in facts["edited"]

    # a second copy under the same name is refused until it is asked for; in another form it is opened again
    save(page, "champion_27-edited.yaml")
    expect(page.get_by_role("alert")).to_contain_text("is there already")
    page.get_by_label("file", exact=True).fill("again.fis")
    page.get_by_role("button", name="Save", exact=True).click()
    expect(status(page)).to_contain_text("wrote again-force_x.fis")
    page.close()
    with served("fis_tools", "edit", "again-force_x.fis", folder=folder) as again:
        opened = open_page(again)
        expect(opened.get_by_label("rule 2:")).to_contain_text("zero")
        assert handle(opened, "positive_small, peak") == dragged
        opened.get_by_text("numbers").last.click()
        entered(opened.get_by_label("name of positive_small"), "up")
        expect(opened.get_by_label("rule 6:")).to_contain_text("up")
        save(opened, "up.fis")
        expect(status(opened)).to_contain_text("wrote up.fis")
        opened.close()
    assert read_controller(folder / "up.fis").systems[0].outputs[0].terms[3].name == "up"
    again = {"again-force_x.fis", "again-force_y.fis", "again-force_z.fis", "up.fis"}
    assert {path.name for path in folder.iterdir()} == {"champion_27.yaml", "champion_27-edited.yaml"} | again


def test_two_pages_do_not_share_their_changes(open_page, address) -> None:
    first, other = open_page(address), open_page(address)
    first.get_by_label("rule 1:").click()
    expect(first.get_by_label("rule 1:")).to_contain_text("small")
    other.get_by_label("rule 5:").click()
    expect(other.get_by_label("rule 5:")).to_contain_text("positive")
    assert (conclusion(first, 5), conclusion(other, 1)) == ("zero", "negative_large")


def test_the_keyboard_suffices(page, tmp_path) -> None:
    page.get_by_label("rule 1:").focus()
    page.keyboard.press("Enter")
    expect(page.get_by_label("rule 1:")).to_contain_text("small")
    page.keyboard.press("ArrowDown")
    expect(page.get_by_label("rule 1:")).to_contain_text("large")
    page.get_by_role("slider", name="aim_radial, value").focus()
    page.keyboard.press("Home")
    expect(page.locator("output").last).not_to_have_text("0 N")
    page.get_by_role("slider", name="zero, peak").first.focus()
    page.keyboard.press("ArrowRight")
    expect(page.get_by_text("1 term changed")).to_be_visible()
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")
    expect(page.get_by_label("rule 1:")).to_contain_text("small")
    words = page.get_by_label("the rule in words")
    entered(words, "If aim_radial is not very negative then force_x is zero with 0.5")
    expect(page.get_by_label("rule 1:").last).to_contain_text("zero × 0.5")
    expect(page.get_by_label("rule 1:").first).to_have_text("not very negative")
    said = words.input_value()
    entered(words, "If aim_radial is huge then force_x is zero")
    expect(status(page)).to_contain_text("huge")
    expect(words).to_have_value(said)
    expect(page.get_by_label("rule 1:").last).to_contain_text("zero × 0.5")
    page.get_by_role("button", name="Save a copy").focus()
    page.keyboard.press("Enter")
    expect(page.get_by_label("file", exact=True)).to_be_focused()
    page.keyboard.press("Control+a")
    page.keyboard.type(str(tmp_path / "typed.json"))
    page.keyboard.press("Enter")
    expect(status(page)).to_contain_text("wrote")
    assert read_controller(tmp_path / "typed.json").systems[0].rules[0].consequents[0].weight == 0.5


def test_an_operator_that_is_taken_back_is_shown_so(page) -> None:
    operator = page.get_by_label("and:")
    operator.press("ArrowDown")
    page.get_by_role("option", name="product", exact=True).last.click()
    expect(page.get_by_text("and operator")).to_be_visible()
    page.get_by_role("button", name="Undo").click()
    expect(page.get_by_text("Nothing changed.")).to_be_visible()
    expect(operator).to_have_value("min")


def test_what_is_no_number_is_refused(page) -> None:
    constant = page.get_by_label("coast_margin_m")
    entered(constant, "far")
    expect(status(page)).to_have_text("'far' is no number; type one such as 0.25")
    expect(constant).to_have_value("4.1")
    page.get_by_label("rule 2:").click()
    expect(status(page)).to_have_text("")
    for button in ("Undo", "Redo"):
        entered(constant, "far")
        expect(status(page)).to_contain_text("no number")
        page.get_by_role("button", name=button).click()
        expect(status(page)).to_have_text("")


def test_everybody_can_use_it(open_page, address, axe) -> None:
    page = open_page(address, 400)
    expect(page.get_by_text("nothing found")).to_be_visible()
    page.get_by_label("rule 2:").click()
    changes = page.get_by_role("region", name="Changes")
    expect(changes.get_by_text("1 of 9 rules changed")).to_be_visible()
    assert '"aim_radial \\ predicted_centre_along_track"' in changes.inner_html()
    assert "predicted_<wbr>centre_<wbr>along_<wbr>track</th>" in changes.inner_html()
    wraps = "cells => cells.map(cell => getComputedStyle(cell).overflowWrap)"
    assert set(changes.locator("th, td").evaluate_all(wraps)) == {"normal"}
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    assert serious_violations(page, axe) == []
    page.emulate_media(color_scheme="dark")
    assert serious_violations(page, axe) == []


#: the colour of the numbers at an axis of a chart once it is that of the page's small print
LABELS = """() => {
    const chart = getElement(Number(document.querySelector(".surface").id.slice(1))).chart;
    const label = chart.getOption().xAxis[0].axisLabel.color;
    return label === getComputedStyle(document.querySelector(".about")).color && label;
}"""


def test_a_surface_has_a_scale_and_the_colours_of_the_page(page) -> None:
    surface = page.get_by_role("region", name="surface")
    expect(surface.locator(".scale")).to_have_text("-0.22-0.1100.110.22force_x (N)")
    colours = set()
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        colours.add(page.wait_for_function(LABELS).json_value())
    assert len(colours) == 2


def test_a_field_that_is_empty_says_what_for(page) -> None:
    words = page.get_by_label("the rule in words")
    expect(words).to_have_attribute("placeholder", "press a rule to change it in words")
    page.get_by_label("rule 2:").focus()
    expect(words).to_have_value(re.compile("^If "))


def test_an_answer_leaves_what_is_being_typed(page) -> None:
    page.get_by_text("numbers").first.click()
    name = page.get_by_label("name of negative").first
    name.fill("negative_far")
    slide = "slider => { slider.value = slider.max; slider.dispatchEvent(new Event('input')); }"
    page.get_by_role("slider", name="aim_radial, value").evaluate(slide)
    expect(page.locator("output").last).not_to_have_text("0 N")  # the answer came
    assert name.input_value() == "negative_far"
    name.press("Enter")
    expect(page.get_by_label("name of negative_far")).to_be_visible()


SLOW = """
import sys
import time
from functools import partial
from pathlib import Path
from nicegui import ui
from fis_tools.edit.page import Editor
from fis_tools.edit.panels import Panel
from fis_tools.edit.server import serve
from fis_tools.edit.session import Session
from fis_tools.source import read_controller

class Slow(Panel):
    title = "Slow"

    def build(self, again):
        self._said = ui.label()

    def answers(self, controller):
        yield partial(self._said.set_text, f"{dict(controller.attributes)['coast_margin_m']} m")
        time.sleep(2.0)

path = Path("champion_27.yaml")
serve(
    lambda: Session(path, read_controller(path)),
    lambda session: Editor(session, [Slow()]),
    "slow",
    opens="--no-browser" not in sys.argv,
    reconnect_s=0.2,
)
"""

#: a browser that stays open while the file is there that it was given
BROWSER = """#!/bin/sh
echo "$1" > "$0.arguments"
path="${1#file://}"
while test -e "$path"; do sleep 0.1; done
"""


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path]]:
    """An editor with a slow panel that opened a browser: its address, and the file that this was given."""
    folder = tmp_path_factory.mktemp("slow")
    shutil.copy(PROJECT / "conf/controller/champion_27.yaml", folder)
    (folder / "slow.py").write_text(SLOW, encoding="utf-8")
    browser = folder / "browser"
    browser.write_text(BROWSER, encoding="utf-8")
    browser.chmod(0o755)
    with served("slow", folder=folder, browser=browser) as address:
        arguments = folder / "browser.arguments"
        while not arguments.exists() or not arguments.read_text(encoding="utf-8").endswith("\n"):
            time.sleep(0.05)
        url = urlsplit(arguments.read_text(encoding="utf-8").strip())
        assert url.scheme == "file"
        yield address, Path(url.path)
    assert not Path(url.path).parent.exists()


def test_a_touch_at_the_end_of_an_answer_is_answered_too(open_page, slow) -> None:
    page = open_page(slow[0])
    said = page.get_by_role("region", name="Slow")
    expect(said.get_by_text("4.1 m")).to_be_visible()
    entered(page.get_by_label("coast_margin_m"), "5")
    expect(said.get_by_text("5 m")).to_be_visible()
    expect(said.locator(".state")).to_have_text("")


def test_no_command_line_holds_the_address_that_a_browser_is_led_to(window, slow) -> None:
    address, redirect = slow
    assert stat.S_IMODE(redirect.stat().st_mode) == 0o600
    assert stat.S_IMODE(redirect.parent.stat().st_mode) == 0o700
    commands = {}
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):  # a process that ended
            commands[path] = path.read_bytes()
    token = urlsplit(address).path.strip("/")
    assert any(redirect.as_uri().encode() in command for command in commands.values())
    assert not [path for path, command in commands.items() if token.encode() in command]
    with closing(window.new_page()) as page:
        page.goto(redirect.as_uri())
        expect(page.get_by_role("heading", name="champion_27")).to_be_visible()
        assert page.url.startswith(address)


def test_changes_outlast_a_page_and_its_connection(open_page, slow) -> None:
    address, _ = slow
    page = open_page(address)
    entered(page.get_by_label("coast_margin_m"), "5")
    expect(page.get_by_role("row", name="coast_margin_m")).to_be_visible()
    page.reload()
    constant = page.get_by_label("coast_margin_m")
    expect(constant).to_have_value("5")
    # another page of the same window shows the same
    mirror = open_page(page.url)
    entered(mirror.get_by_label("coast_margin_m"), "6")
    expect(constant).to_have_value("6")
    mirror.close()
    page.get_by_role("button", name="Undo").click()
    expect(constant).to_have_value("5")
    # away for longer than the server keeps a page
    page.evaluate("window.isBefore = true; window.socket.disconnect()")
    page.wait_for_timeout(1_000)
    page.evaluate("window.socket.connect()")
    page.wait_for_function("!window.isBefore")
    expect(constant).to_have_value("5")
    page.get_by_role("button", name="Undo").click()
    expect(constant).to_have_value("4.1")
    page.get_by_role("button", name="Redo").click()
    expect(constant).to_have_value("5")
    # a closed window's changes are offered where the address is opened again
    page.close()
    new = open_page(address)
    expect(new.get_by_label("coast_margin_m")).to_have_value("4.1")
    if not new.get_by_role("link", name="Show them").count():  # the server had not noticed yet
        new.reload()
    new.get_by_role("link", name="Show them").click()
    expect(new.get_by_label("coast_margin_m")).to_have_value("5")


QUERY = "?EIO=4&transport=websocket"


def status_of(address: str, path: str, **headers: str) -> int:
    parts = urlsplit(address)
    fields = {name.replace("_", "-"): value for name, value in headers.items()}
    with closing(http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=60)) as connection:
        connection.request("GET", path, headers=fields)
        with closing(connection.getresponse()) as response:
            return response.status


def test_only_who_knows_the_address_is_answered_and_no_other_page(address) -> None:
    parts = urlsplit(address)
    origin, socket_path = f"http://{parts.netloc}", f"{parts.path}_nicegui_ws/socket.io/{QUERY}"
    assert status_of(address, parts.path) == 200
    elsewhere = ("/", f"/{'x' * 32}/", f"/_nicegui_ws/socket.io/{QUERY}")
    assert [status_of(address, path) for path in elsewhere] == [403] * 3
    assert status_of(address, parts.path, Origin="http://example.org") == 403
    assert status_of(address, parts.path, Host="example.org") == 403
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec_WebSocket_Version": "13"}
    upgrade["Sec_WebSocket_Key"] = "dGhlIHNhbXBsZSBub25jZQ=="
    assert status_of(address, socket_path, Origin=origin, **upgrade) == 101
    assert status_of(address, socket_path, Origin="http://example.org", **upgrade) == 403
    assert status_of(address, socket_path.replace(parts.path, "/"), Origin=origin, **upgrade) == 403
    with pytest.raises(OSError, match="refused"):  # this machine's other names are not listened at
        socket.create_connection(("127.0.0.2", parts.port), timeout=5)


def test_a_damaged_file_ends_in_a_sentence(folder, tmp_path) -> None:
    damaged = tmp_path / "champion_27.yaml"
    damaged.write_text((folder / "champion_27.yaml").read_text(encoding="utf-8")[:3000], encoding="utf-8")
    done = run_python("-m", "fis_tools", "edit", damaged, "--no-browser", code=2)
    assert done.stderr.startswith(f"error: {damaged}: ")
    assert done.stdout == ""
