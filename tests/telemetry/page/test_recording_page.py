"""A recording as a page: what it has is played under one time, whoever wrote it."""

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from telemetry.file.topics import DEPUTY_STATE
from telemetry.page import recorded
from tests.browser import serious_violations
from tests.telemetry.synthetic_flight import NUM_POINTS

pytestmark = pytest.mark.slow

READY = "() => globalThis.player?.sides?.[0].flight"
AT = """k => {
    const side = player.sides[0], { flight } = side;
    player.lead.view.show(k);
    const { position, numSeen, spent, sun } = flight;
    return { position: position(k), seen: numSeen(k), spent: spent(k), sun: sun(k) };
}"""


def of_state_alone(source, path):
    """Copy the messages that say where the deputy is, as another program may have written them."""
    with source.open("rb") as stream, path.open("wb") as output:
        reader, writer = make_reader(stream), Writer(output)
        writer.start()
        for schema, channel, message in reader.iter_messages([DEPUTY_STATE]):
            if message.sequence == 0 or not writer._Writer__channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                number = writer.register_channel(channel.topic, channel.message_encoding, known)
            writer.add_message(number, message.log_time, message.data, message.publish_time)
        writer.finish()
    return path


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1400])
def test_a_recording_is_played_as_it_was(opened, axe, flight, flight_file, width, scheme):
    page = opened(recorded.write(flight_file), width, color_scheme=scheme, reduced_motion="reduce")
    page.wait_for_function(READY)
    for k in (0, 123, 360):
        shown = page.evaluate(AT, k)
        np.testing.assert_allclose(shown["position"], flight.position_m[k], rtol=1e-6)
        assert shown["seen"] == flight.inspected[k].sum()
        assert shown["spent"] == pytest.approx(flight.delta_v_m_s[k], rel=1e-6)
        sun = flight.sun_angle_rad[k]
        np.testing.assert_allclose(shown["sun"], [np.cos(sun), np.sin(sun), 0.0], atol=1e-6)
        page.wait_for_function("k => player.lead.view.heard === k", arg=k)
        sliders = page.locator("#player svg[role=slider]").all()
        assert {each.get_attribute("aria-valuenow") for each in sliders} == {str(k)}
        assert page.locator("#player .time").input_value() == str(k)
    assert page.locator("#player .map circle").count() == NUM_POINTS + 1
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert serious_violations(page, axe) == []


def test_a_recording_of_another_program_needs_no_more_than_places(opened, flight, flight_file, tmp_path):
    path = of_state_alone(flight_file, tmp_path / "foreign.mcap")
    text = recorded.write(path)
    assert "It does not tell points of the chief, forces, where the Sun is, or what was spent." in text
    page = opened(text, reduced_motion="reduce")
    page.wait_for_function(READY)
    shown = page.evaluate(AT, 200)
    np.testing.assert_allclose(shown["position"], flight.position_m[200], rtol=1e-6)
    assert shown["sun"] is None
    assert page.locator("#player .map").is_hidden()
    assert page.locator("#player .fuel").is_hidden()


def test_the_command_writes_a_page_beside_the_recording(ran, flight_file, tmp_path):
    path = tmp_path / "flight.mcap"
    path.write_bytes(flight_file.read_bytes())
    assert str(tmp_path / "flight.html") in ran("page", path).out
    assert (tmp_path / "flight.html").read_text(encoding="utf-8") == recorded.write(path)
    assert len((tmp_path / "flight.html").read_bytes()) < 200_000


def test_a_recording_without_places_is_refused(ran, flight_file, tmp_path):
    path = tmp_path / "empty.mcap"
    with path.open("wb") as output:
        writer = Writer(output)
        writer.start()
        writer.finish()
    assert "says where the deputy is" in ran("page", path, code=2).err


def test_recordings_that_are_not_of_one_fleet_stand_beside_each_other(opened, flight_file):
    text = recorded.write(flight_file, flight_file)
    page = opened(text, 1400, reduced_motion="reduce")
    page.wait_for_function(READY)
    assert page.evaluate("() => player.sides.map(({ view }) => view.fellows.length)") == [0, 0]
    assert "fly together" not in text
