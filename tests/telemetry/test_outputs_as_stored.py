"""What commands print and files hold is as it was when somebody last looked: words, columns, messages."""

import re

import numpy as np
import pytest
from mcap.reader import make_reader

import telemetry
from telemetry.file import compare, recover, summary, topics
from telemetry.page import panel, recorded
from tests import stored
from tests.telemetry import synthetic_flight

#: bytes depend on libraries that compress
BYTES = re.compile(r"\b[\d.,]+ (bytes|KiB|MiB)\b|\"bytes\": \d+")


def words(text, folder):
    return stored.rounded(BYTES.sub("SIZE", text.replace(str(folder), "FOLDER")))


def changed(flight):
    """The flight with a few numbers that differ: by little, by much, and from some time on."""
    position = flight.position_m.copy()
    position[7:, 1] += 0.125
    force = flight.force_hill_n * 1.001
    return flight.but(
        position_m=position,
        force_hill_n=force,
        sun_angle_rad=flight.sun_angle_rad + 0.25 + 0.01 * np.arange(13),
    )


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return tmp_path_factory.mktemp("small")


@pytest.fixture(scope="module")
def flown():
    return synthetic_flight.fly(12)


@pytest.fixture(scope="module")
def first(small, flown):
    return synthetic_flight.record(flown, small / "first.mcap")


@pytest.fixture(scope="module")
def other(small, flown):
    return synthetic_flight.record(changed(flown), small / "other.mcap")


@pytest.fixture(scope="module")
def shorter(small):
    return synthetic_flight.record(synthetic_flight.fly(9), small / "shorter.mcap")


def test_what_info_prints_is_as_it_was(first, small, ran, file_regression):
    text = ran("info", first).out + ran("info", "--json", first).out
    file_regression.check(words(text, small), extension=".txt")


def test_how_flights_differ_is_told_as_it_was(first, other, shorter, small, ran, file_regression):
    text = ""
    for pair in ((first, first), (first, other), (first, shorter), (shorter, other)):
        text += ran("compare", *pair, code=None).out
    text += ran("compare", first, other, "--tolerance", 0.2, code=None).out
    file_regression.check(words(text, small), extension=".txt")


def test_tables_of_a_flight_are_as_they_were(first, tmp_path, ran, file_regression):
    text = ran("export", first, "--output", tmp_path).out
    for path in sorted(tmp_path.rglob("*.csv")):
        head, *lines = path.read_text(encoding="utf-8").splitlines()
        text += "\n".join([f"== {path.name}, {len(lines)} rows", head, lines[0][:700], lines[-1][:700], ""])
    file_regression.check(words(text, tmp_path), extension=".txt")


def test_messages_of_a_file_are_as_they_were(first, file_regression):
    """Channels, metadata and how many messages each has, by the library's own reader."""
    lines, times = [], {}
    with first.open("rb") as stream:
        reader = make_reader(stream)
        shown = reader.get_summary()
        for channel in shown.channels.values():
            schema = shown.schemas[channel.schema_id]
            count = shown.statistics.channel_message_counts.get(channel.id, 0)
            lines.append(
                f"{channel.topic} {channel.message_encoding} {schema.name} {schema.encoding} {count}"
            )
        for _, channel, message in reader.iter_messages():
            times.setdefault(channel.topic, []).append(
                (message.log_time, message.publish_time, message.sequence)
            )
        for each in reader.iter_metadata():
            lines += [f"{each.name} {key}: {value}" for key, value in each.metadata.items()]
        lines += [
            f"{each.name} {each.media_type} {each.log_time} {each.data!r}"
            for each in reader.iter_attachments()
        ]
    lines += [f"{topic} {stored.array(np.array(rows) / 1e9)}" for topic, rows in times.items()]
    file_regression.check(stored.rounded("\n".join(lines)) + "\n", extension=".txt")


def test_columns_of_a_recording_are_as_they_were(first, file_regression):
    recording = telemetry.read(first)
    parts = {topic: {"time_s": of.time_s, **of.columns} for topic, of in recording.topics.items()}
    others = {
        name: getattr(recording, name)
        for name in ("outcome", "end_s", "last_sample", "fis_names", "command_age_s")
    }
    for name in recording.fis_names:
        others[name] = recording.fis_description(name), recording.fired(name)
        others[f"{name} reasons"] = recording.reasons(name, recording.control_time_s)
    file_regression.check(stored.text_of(parts | others), extension=".txt")


def test_a_summary_and_a_comparison_as_data_are_as_they_were(first, other, small, file_regression):
    recordings = [telemetry.read(path) for path in (first, other)]
    parts = {"summary": summary.summarize(recordings[0]), "compared": compare.compare(*recordings)}
    file_regression.check(words(stored.text_of(parts, ("bytes", "path")), small), extension=".txt")


def test_what_is_rescued_is_as_it_was(tmp_path, ran, file_regression):
    whole = synthetic_flight.record(synthetic_flight.fly(130), tmp_path / "whole.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: int(0.8 * len(whole))])
    printed = ran("recover", cut, code=None)
    rescued = telemetry.read(tmp_path / "cut.recovered.mcap")
    parts = {"out": printed.out, "err": printed.err, "metadata": dict(rescued.metadata)}
    parts |= {topic: len(of) for topic, of in rescued.topics.items()}
    again = recover.recover(cut, tmp_path / "again.mcap")
    parts |= {"messages": again.num_messages, "end_s": again.end_s}
    file_regression.check(words(stored.text_of(parts), tmp_path), extension=".txt")


@pytest.mark.parametrize("count", [1, 2])
def test_what_a_page_is_given_is_as_it_was(count, first, other, monkeypatch, file_regression):
    given, original = [], panel.panel
    monkeypatch.setattr(
        recorded, "panel", lambda *words, **more: given.append(words) or original(*words, **more)
    )
    text = stored.page(recorded.write(*(first, other)[:count]))
    file_regression.check(text + stored.text_of([words[:3] for words in given]), extension=".txt")


def test_reasons_are_as_they_were_where_several_act(flown, tmp_path, file_regression):
    """Each sample has another reason along each axis."""
    path = synthetic_flight.record(flown, tmp_path / "x.mcap")
    recording = telemetry.read(path)
    times = recording.control_time_s
    kinds = [each.name.lower() for each in topics.Reason]
    parts = {axis: recording.fired_reasons(axis, times) for axis in ("force_x", "force_y", "force_z")}
    file_regression.check(stored.text_of({"kinds": kinds} | parts), extension=".txt")
