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
from telemetry.commands import main


def test_info_tells_what_it_was_and_how_it_went(flight_file, capsys):
    assert main(["info", str(flight_file)]) == 0
    text = capsys.readouterr().out
    for expected in (
        r"KiB, 0 to 3600 s",
        r"inspection rate +97\.98 %",
        r"distance +75\.0 to 75\.0 m",
        r"f_y: lambda_u \(rad\), velocity_body_y \(m/s\) -> f_y \(N\), 25 rules",
        r"/fis/f_z +360 x inspection\.FisActivation",
        r"controller\.json +19 bytes",
    ):
        assert re.search(expected, text), expected
    # the same to programs
    assert main(["info", "--json", str(flight_file)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["bytes"], told["end_s"], told["is_rescued"]) == (flight_file.stat().st_size, 3600.0, False)
    assert told["episode"]["scenario_id"] == "circle-0"
    assert (told["outcome"]["inspected_count"], told["outcome"]["num_points"]) == (97, 99)
    assert told["fuzzy_systems"]["f_y"]["inputs"] == {"lambda_u": "rad", "velocity_body_y": "m/s"}
    assert told["topics"]["/tf"] == {"schema": "foxglove.FrameTransform", "messages": 723}
    assert told["attachments"] == {"config.yaml": 8, "controller.json": 19}


def test_a_cut_file_is_sent_to_recover_which_rescues_it(short_file, tmp_path, capsys):
    path = tmp_path / "cut.mcap.partial"
    path.write_bytes(short_file.read_bytes()[:80_000])
    assert main(["info", str(path)]) == 2
    assert f"`python -m telemetry recover {path}`" in capsys.readouterr().err
    assert main(["recover", str(path)]) == 0
    assert "cut.recovered.mcap holds " in capsys.readouterr().out
    assert len(telemetry.read(tmp_path / "cut.recovered.mcap")["/deputy/state"]) == 60
    assert main(["info", str(tmp_path / "cut.recovered.mcap")]) == 0
    assert "the flight may have gone on" in capsys.readouterr().out


def test_recover_warns_where_no_step_is_left_and_info_tells_the_rest(short_file, tmp_path, capsys):
    whole, path = short_file.read_bytes(), tmp_path / "cut it.mcap"
    # the attachments are whole, the first chunk is not
    path.write_bytes(whole[: whole.index(b"controller.json") + 2_000])
    assert main(["info", str(path)]) == 2
    assert f"`python -m telemetry recover '{path}'`" in capsys.readouterr().err
    assert main(["recover", str(path)]) == 0
    captured = capsys.readouterr()
    assert "holds 0 messages; " in captured.out
    assert captured.err.startswith(f"warning: no step of the flight could be rescued from {path}")
    assert main(["info", str(tmp_path / "cut it.recovered.mcap")]) == 0
    text = capsys.readouterr().out
    assert "KiB, no messages" in text
    assert re.search(r"scenario_id +circle-0", text)
    assert re.search(r"topics\n  none", text)


@pytest.fixture
def own(short_file, tmp_path):
    """A flight in a folder of its own."""
    return Path(shutil.copy(short_file, tmp_path / "flight.mcap"))


def test_export_makes_a_folder_beside_the_file(own, capsys):
    assert main(["export", str(own), "--format", "csv"]) == 0
    printed = capsys.readouterr().out.split()
    assert str(own.parent / "flight-csv" / "mission.csv") in printed
    assert all(Path(name).is_file() for name in printed)


def test_replay_saves_a_file_but_not_over_its_flight(own, short_file, tmp_path, capsys):
    output = tmp_path / "short.rrd"
    assert main(["replay", str(own), "--save", str(output)]) == 0
    assert output.read_bytes()[:3] == b"RRF"
    assert f"rerun {output}" in capsys.readouterr().out
    assert main(["replay", str(own), "--save", str(own)]) == 2
    assert "choose a name such as" in capsys.readouterr().err
    assert own.read_bytes() == short_file.read_bytes()


@pytest.mark.parametrize("command", ["info", "replay", "recover", "export"])
def test_a_mistake_is_one_sentence_and_exit_code_two(tmp_path, capsys, command):
    path = tmp_path / "notes.txt"
    path.write_text("not a recording")
    arguments = [command, str(path), *(["--save", str(tmp_path / "x.rrd")] if command == "replay" else [])]
    assert main(arguments) == 2
    captured = capsys.readouterr()
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


def test_a_command_is_needed_and_of_one_that_is_gone_its_successors_are_told(capsys):
    assert main([]) == 2
    assert main(["training", "outputs/train/RUN", "--follow"]) == 2
    assert "telemetry: training is gone: a run's report.html draws the" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command", ["replay", "campaign", "screenshot", "info", "recover", "export", "compare"]
)
def test_each_command_teaches_by_examples_that_it_takes(command, capsys):
    assert main([command, "--help"]) == 0
    examples = re.findall(r"^ python -m telemetry (.*)$", capsys.readouterr().out, flags=re.MULTILINE)
    assert len(examples) >= 2
    for example in examples:
        assert example.split()[0] == command
        # what is named is not there, but the options are known
        assert main(shlex.split(example)) == 2


@pytest.mark.parametrize("instant", ["nan", "inf", "-5", "soon"])
def test_an_instant_that_cannot_be_is_refused(instant, capsys):
    assert main(["screenshot", "flight.mcap", "--at", instant]) == 2
    assert instant in capsys.readouterr().err


def test_an_interrupted_command_ends_in_a_sentence(short_file, monkeypatch, capsys):
    def interrupted(_path):
        raise KeyboardInterrupt

    monkeypatch.setattr(commands, "read", interrupted)
    assert main(["info", str(short_file)]) == 130
    assert capsys.readouterr().err == "telemetry: interrupted\n"


def test_a_whole_file_that_never_got_its_name_is_to_be_renamed(own, capsys):
    path = own.rename(own.with_name("flight.mcap.partial"))
    assert main(["recover", str(path)]) == 0
    assert "rename it to flight.mcap" in capsys.readouterr().out


def test_somebody_elses_recording_has_nothing_to_compare_or_export(tmp_path, capsys):
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel("/a", "json", writer.register_schema("x", "jsonschema", b"{}"))
        writer.add_message(channel, 5, b"{}", 5)
        writer.finish()
    assert main(["compare", str(path), str(path)]) == 2
    assert main(["export", str(path), "-o", str(tmp_path / "tables")]) == 2
    assert capsys.readouterr().err.count("messages of a flight") == 2
    assert not (tmp_path / "tables").exists()
