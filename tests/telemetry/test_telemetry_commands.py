"""The commands: what they print, what they make, and one clear sentence on a mistake."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.writer import Writer

import telemetry
from telemetry import commands


def test_info_tells_what_it_was_and_how_it_went(flight_file, ran):
    text = ran("info", flight_file).out
    for expected in (
        r"KiB, 0 to 3600 s",
        r"inspection rate +97\.98 %",
        r"distance +75\.0 to 75\.0 m",
        r"force_y: lambda_u \(rad\), velocity_body_y \(m/s\) -> force_y \(N\), 25 rules",
        r"/fis/force_z +360 x inspection\.FisActivation",
        r"controller\.json +19 bytes",
    ):
        assert re.search(expected, text), expected
    # the same to programs
    printed = json.loads(ran("info", "--json", flight_file).out)
    assert (printed["bytes"], printed["end_s"], printed["is_rescued"]) == (
        flight_file.stat().st_size,
        3600.0,
        False,
    )
    assert printed["episode"]["scenario_id"] == "circle-0"
    assert (printed["outcome"]["inspected_count"], printed["outcome"]["num_points"]) == (97, 99)
    assert printed["fuzzy_systems"]["force_y"]["inputs"] == {"lambda_u": "rad", "velocity_body_y": "m/s"}
    assert printed["topics"]["/tf"] == {"schema": "foxglove.FrameTransform", "messages": 723}
    assert printed["attachments"] == {"config.yaml": 8, "controller.json": 19}


def test_a_cut_file_is_sent_to_recover_which_rescues_it(short_file, tmp_path, ran):
    path = tmp_path / "cut.mcap.partial"
    path.write_bytes(short_file.read_bytes()[:80_000])
    assert f"`python -m telemetry recover {path}`" in ran("info", path, code=2).err
    assert "cut.recovered.mcap holds " in ran("recover", path).out
    assert len(telemetry.read(tmp_path / "cut.recovered.mcap")["/deputy/state"]) == 60
    assert "the flight may have gone on" in ran("info", tmp_path / "cut.recovered.mcap").out


def test_recover_warns_where_no_step_is_left_and_info_tells_the_rest(short_file, tmp_path, ran):
    whole, path = short_file.read_bytes(), tmp_path / "cut it.mcap"
    # the attachments are whole, the first chunk is not
    path.write_bytes(whole[: whole.index(b"controller.json") + 2_000])
    assert f"`python -m telemetry recover '{path}'`" in ran("info", path, code=2).err
    captured = ran("recover", path)
    assert "holds 0 messages; " in captured.out
    assert captured.err.startswith("warning: no step of the flight")
    assert str(path) in captured.err
    text = ran("info", tmp_path / "cut it.recovered.mcap").out
    assert "KiB, no messages" in text
    assert re.search(r"scenario_id +circle-0", text)
    assert re.search(r"topics\n  none", text)


@pytest.fixture
def flight_copy(short_file, tmp_path):
    """A flight in a folder of its own."""
    return Path(shutil.copy(short_file, tmp_path / "flight.mcap"))


def test_export_makes_a_folder_beside_the_file(flight_copy, ran):
    printed = ran("export", flight_copy, "--format", "csv").out.split()
    assert str(flight_copy.parent / "flight-csv" / "mission.csv") in printed
    assert all(Path(name).is_file() for name in printed)


def test_replay_saves_a_file_but_not_over_its_flight(flight_copy, short_file, tmp_path, ran):
    output = tmp_path / "short.rrd"
    assert f"rerun {output}" in ran("replay", flight_copy, "--save", output).out
    assert output.read_bytes()[:3] == b"RRF"
    assert "choose a name such as" in ran("replay", flight_copy, "--save", flight_copy, code=2).err
    assert flight_copy.read_bytes() == short_file.read_bytes()


@pytest.mark.parametrize("command", ["info", "replay", "recover", "export"])
def test_a_mistake_is_one_sentence_and_exit_code_two(tmp_path, ran, command):
    path = tmp_path / "notes.txt"
    path.write_text("not a recording")
    saved = ["--save", tmp_path / "x.rrd"] if command == "replay" else []
    captured = ran(command, path, *saved, code=2)
    assert captured.out == ""
    assert captured.err.startswith("telemetry: ")
    assert "is not an MCAP file" in captured.err
    assert captured.err.count("\n") == 1


def test_output_that_nobody_reads_to_its_end_is_no_error(flight_file):
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "telemetry", "info", str(flight_file)]
    done = subprocess.run(command, check=False, stdout=writer, stderr=subprocess.PIPE)  # noqa: S603
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, b"")


def test_a_command_is_needed_and_of_one_that_is_gone_its_successors_are_told(ran):
    ran(code=2)
    message = ran("training", "outputs/train/RUN", "--follow", code=2).err
    assert "telemetry: training is gone: a run's report.html draws the" in message


@pytest.mark.parametrize(
    "command", ["replay", "campaign", "screenshot", "info", "recover", "export", "compare"]
)
def test_each_command_teaches_by_examples_that_it_takes(command, ran):
    examples = re.findall(r"^ python -m telemetry (.*)$", ran(command, "--help").out, flags=re.MULTILINE)
    assert len(examples) >= 2
    for example in examples:
        assert example.split()[0] == command
        # what is named is not there, but the options are known
        ran(*shlex.split(example), code=2)


@pytest.mark.parametrize("instant", ["nan", "inf", "-5", "soon"])
def test_an_instant_that_cannot_be_is_refused(instant, ran):
    assert instant in ran("screenshot", "flight.mcap", "--at", instant, code=2).err


def test_an_interrupted_command_ends_in_a_sentence(short_file, monkeypatch, ran):
    def interrupted(_path):
        raise KeyboardInterrupt

    monkeypatch.setattr(commands, "read", interrupted)
    assert ran("info", short_file, code=130).err == "telemetry: interrupted\n"


def test_a_whole_file_that_never_got_its_name_is_to_be_renamed(flight_copy, ran):
    path = flight_copy.rename(flight_copy.with_name("flight.mcap.partial"))
    assert "rename it to flight.mcap" in ran("recover", path).out


def test_somebody_elses_recording_has_nothing_to_compare_or_export(tmp_path, ran):
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel("/a", "json", writer.register_schema("x", "jsonschema", b"{}"))
        writer.add_message(channel, 5, b"{}", 5)
        writer.finish()
    for words in (["compare", path], ["export", "-o", tmp_path / "tables"]):
        assert "messages of a flight" in ran(*words, path, code=2).err
    assert not (tmp_path / "tables").exists()
