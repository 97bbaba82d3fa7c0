"""The on-board function in C commands what the flight commanded, bit for bit, and refuses bad input."""

import csv
import errno
import itertools
import os
import platform
import re
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import trimesh
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

from benchmarks.onboard import FAULTS, proved
from docs.scripts.shown import BLOCK
from fis_tools.formats import serialize
from fis_tools.formats.c.text import WARNINGS
from pipeline.command_line import cli
from pipeline.controllers.source import named
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.fly.stepping import SteppedFlights
from pipeline.flight.fly.tours import tour_images
from pipeline.flight.period.decide import urgency
from pipeline.flight.state.log import AXIS_SPEED, REHEARSED
from pipeline.onboard.allowed import NotTranslatableError
from pipeline.onboard.export import export
from pipeline.onboard.fmi import variables
from pipeline.onboard.program import translate
from pipeline.onboard.recorded import OUTPUT, Library, differing, recorded
from pipeline.onboard.source import sources
from pipeline.run.maker import product_version
from tests import night, programs
from tests.fis_tools.sample_controllers import SHIPPED
from tests.pipeline.flight.cases import mission, random_starts
from tests.smoke.pages import DOCS

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc compiles what is written"),
]
STUBS = Path(__file__).parent / "stubs"
SHORT = mission(duration_s=1200.0)
#: bits of the status, as the header defines them
BAD_SUN, BAD_START, BAD_PARAMETERS = 16, 64, 128
#: a controller's name that would end comments, close attributes of XML and begin a directive
HOSTILE = '27 */ #error "<a> & ??/'


@cache
def controller(name):
    """A shipped controller; one that rehearses tours follows its first."""
    whole = from_fuzzy(serialize.load(SHIPPED[name]))
    return (tour_images(whole) or (whole,))[0]


def written(program, folder):
    source = sources(program)
    (folder / "controller.h").write_text(source.header)
    (folder / "controller.c").write_text(source.code)
    return Library(folder, flags=("-std=c99", "-O0", "-ffp-contract=off"))


@pytest.fixture(scope="module", params=night.by_day([*SHIPPED], 2))
def shipped(request, tmp_path_factory):
    program = translate(SHORT, controller(request.param))
    library = written(program, tmp_path_factory.mktemp("shipped"))
    (start,) = random_starts(1, seed=sorted(SHIPPED).index(request.param))
    log = fly_logged(SHORT, program.controller, start)
    return program, library, recorded(program, start, log), log


def test_a_step_before_the_start_or_with_a_parameter_that_is_no_number_fires_nothing(shipped):
    program, library, flight, _ = shipped
    output, step = np.zeros(1, OUTPUT), flight.steps[:1].copy()
    step["is_given"] = 0  # what is given is fired, whatever the parameters are

    def refused(bit):
        library.step(step, output)
        return output["status"][0] == bit and not np.any(output["force_n"])

    (_, designed), *_ = program.choices
    designed = [designed[name] for name in program.parameters]
    library.choose(designed)
    assert refused(BAD_START)
    for field, value in itertools.product(("sun_angle", "sun_elevation"), (np.nan, np.inf, 2.0)):
        start = flight.start.copy()
        start[field][0] = value
        assert library.start(start) == BAD_SUN
        assert refused(BAD_START)
    assert library.start(flight.start) == 0
    for index, value in itertools.product(range(len(designed)), (np.nan, np.inf)):
        library.choose([*designed[:index], value, *designed[index + 1 :]])
        assert refused(BAD_PARAMETERS)
    library.choose(designed)
    assert refused(0) or np.any(output["force_n"])


def test_c_commands_what_was_commanded_and_for_the_same_reason(shipped):
    _, library, flight, log = shipped
    answers = library.answers(flight)
    assert len(differing(answers, log)) == 0
    assert np.any(answers["leading_rule"] > 0) or np.any(answers["reason"] == REHEARSED)


def test_clusters_are_those_of_the_flight(tmp_path):
    clustered = mission(duration_s=1200.0, guidance={"kind": "clusters"})
    program = translate(clustered, controller("paper_champion"))
    library = written(program, tmp_path)
    (start,) = random_starts(1, seed=5)
    log = fly_logged(clustered, program.controller, start)
    assert len(differing(library.answers(recorded(program, start, log)), log)) == 0
    assert len(np.unique(log.target_m, axis=0)) > 20  # it is a centre that moves


def test_the_sun_may_stand_out_of_the_orbit_plane(tmp_path):
    program = translate(SHORT, controller("champion_27"), is_tilted=True)
    library = written(program, tmp_path)
    (start,) = random_starts(1, seed=5)
    start = replace(start, sun_elevation_rad=0.4)
    log = fly_logged(SHORT, program.controller, start)
    flight = recorded(program, start, log)
    assert len(differing(library.answers(flight), log)) == 0
    assert np.any(log.force_commanded_n)
    (tmp_path / "flat").mkdir()
    answers = written(translate(SHORT, program.controller), tmp_path / "flat").answers(flight)
    assert np.all(answers["status"] == BAD_SUN + BAD_START)
    assert not np.any(answers["force_n"])


@pytest.mark.parametrize("axis_speed_limit_m_s", [0.0, 0.02])
def test_the_safety_layer_changes_the_same_forces_for_the_same_limit(tmp_path, axis_speed_limit_m_s):
    safety = {"kind": "filter", "axis_speed_limit_m_s": axis_speed_limit_m_s}
    guarded = mission(duration_s=1200.0, safety=safety, deputy={"min_distance_m": 45.0})
    program = translate(guarded, controller("champion_27"))
    library = written(program, tmp_path)
    acted = 0
    for start in random_starts(3, seed=5):
        log = fly_logged(guarded, program.controller, start)
        answers = library.answers(recorded(program, start, log))
        assert len(differing(answers, log)) == 0
        assert np.array_equal(answers["safety_limit"], log.safety_limit)
        acted += np.count_nonzero(
            log.safety_limit == AXIS_SPEED if axis_speed_limit_m_s else log.safety_limit
        )
    assert acted > 0


@pytest.mark.parametrize("is_convex", [False, True])
def test_what_a_chief_hides_of_itself_takes_a_bit_a_cell_and_nothing_if_it_is_convex(tmp_path, is_convex):
    chief = {"shape": "mesh"}
    if is_convex:
        trimesh.creation.box((6.0, 4.0, 3.0)).export(tmp_path / "box.obj")
        chief["path"] = str(tmp_path / "box.obj")
    shaped = mission(duration_s=1200.0, chief=chief)
    program = translate(shaped, controller("champion_27"))
    library = written(program, tmp_path)
    for start in random_starts(2, seed=5):
        log = fly_logged(shaped, program.controller, start)
        assert len(differing(library.answers(recorded(program, start, log)), log)) == 0
        assert np.any(log.force_commanded_n)
    cells, num_points = program.world.occlusion.is_free.shape
    tables = sources(program).tables
    assert tables.get("free_cells", 0) == (0 if is_convex else cells * -(-num_points // 8))
    assert max(tables.values()) < cells * num_points / 4


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exported")
    program = translate(SHORT, replace(controller("champion_27"), name=HOSTILE))
    return folder, program, export(program, random_starts(2, seed=1), folder)


def test_the_evidence_counts_what_the_recorded_flights_run(exported):
    folder, program, result = exported
    read = {
        name: list(csv.DictReader((folder / "evidence" / f"{name}.csv").read_text().splitlines()))
        for name in ("loops", "rules", "stack", "traceability")
    }
    code = (folder / "controller.c").read_text().splitlines()
    assert len(read["rules"]) == sum(len(system.rules) for system in program.controller.systems)
    assert all(row["words"] in joined(code, int(row["line of controller.c"])) for row in read["rules"])
    assert any(int(row["commands it led"]) for row in read["rules"])
    runs = {int(row["line of controller.c"]): row["runs in main.c"] for row in read["traceability"]}
    (first,) = (k for k, line in enumerate(code, start=1) if line.startswith("static void note_deadlines"))
    assert runs[first] == "2"  # once a flight
    assert all(int(row["at most"]) > 0 for row in read["loops"])
    step = next(row for row in read["stack"] if row["function"] == "controller_step")
    assert int(step["with what it calls"]) == result.sizes.stacks["controller_step"] > 0


def test_the_analyser_finds_no_error_for_any_input_and_reaches_what_is_written(exported, tmp_path):
    """Any input, any parameters, in any number of flights: `any_input.c`; by day of one system's rules."""
    folder, program, _ = exported
    programs.program("frama-c", "frama-c-base")
    if not night.IS_WHOLE:  # each system takes the analyser half a minute
        smaller = replace(program.controller, systems=program.controller.systems[-1:])
        folder = tmp_path
        export(translate(SHORT, smaller), random_starts(1, seed=1), folder)
    alarms, reached = proved(folder)
    assert alarms == 0
    assert reached >= 98.0


@pytest.mark.skipif(not night.IS_WHOLE, reason="a minute and a half of the analyser: each night")
def test_the_check_of_a_folder_fails_if_the_analyser_leaves_an_alarm(exported, tmp_path):
    programs.program("frama-c", "frama-c-base")
    folder = shutil.copytree(exported[0], tmp_path / "faulty")
    code = folder / "controller.c"
    code.write_text(re.sub(*FAULTS["a signal that is not finite"], code.read_text(), count=1))
    path = alone(tmp_path, "frama-c", "sed", "grep", "tail")
    script = ["/bin/sh", folder / "evidence" / "check.sh"]
    done = subprocess.run(script, check=False, env={"PATH": path}, capture_output=True, text=True)  # noqa: S603
    assert "0 commands differ" in done.stdout  # a number in range is not changed
    assert re.search(r"[1-9]\d* alarms? generated", done.stdout)
    assert done.returncode == 1


@pytest.mark.parametrize("failure", [KeyboardInterrupt(), OSError(errno.ENOSPC, "No space left on device")])
def test_an_export_that_fails_leaves_nothing(exported, failure, tmp_path, monkeypatch):
    def fail(*_):
        raise failure

    monkeypatch.setattr("pipeline.onboard.export.vector_source", fail)
    folder = tmp_path / "new" / "export"
    with pytest.raises(type(failure)):
        export(exported[1], random_starts(1, seed=1), folder)
    assert list(tmp_path.iterdir()) == []
    folder.mkdir(parents=True)
    with pytest.raises(type(failure)):
        export(exported[1], random_starts(1, seed=1), folder)
    assert list(folder.iterdir()) == []


def joined(code, line):
    """The text of a comment from a line on, its lines joined."""
    return " ".join(part.removeprefix(" * ") for part in code[line - 1 : line + 4])


def test_the_c_flies_in_closed_loop_to_the_same_states(exported, library):
    _, program, _ = exported
    (start,) = random_starts(1, seed=4)
    log = fly_logged(SHORT, program.controller, start)
    flight = recorded(program, start, log)
    flights = SteppedFlights(SHORT, 1, is_tilted=start.sun_elevation_rad != 0.0)
    flights.start(0, start)
    flights.step(np.zeros((1, 3)))
    library.start(flight.start)
    output = np.zeros(1, OUTPUT)
    for k in range(len(flight.steps)):
        step = flight.steps[k : k + 1].copy()
        step["position_m"], step["velocity_m_s"] = flights.observed[0, :3], flights.observed[0, 3:6]
        step["unseen"] = (flight.start["counts"] > 0) & ~flights.is_inspected[0]
        library.step(step, output)
        flights.step(output["force_n"])
        assert np.array_equal(flights.observed[0, :3], log.position_m[k + 1])
        assert np.array_equal(flights.is_inspected[0], log.is_inspected[k + 1])
    assert np.any(log.force_commanded_n)


def test_an_export_is_compared_and_compiles_without_warnings_as_c_and_cpp(exported):
    folder, _, result = exported
    assert (result.num_different, result.num_commands) == (0, 240)
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert [path for path in files if HOSTILE.encode() in path.read_bytes()] == []
    strict = ["-Wstrict-prototypes", "-Wmissing-prototypes"]
    for compiler in (["gcc", "-std=c99", *strict], ["g++", "-std=c++17", "-x", "c++"]):
        command = [*compiler, *WARNINGS, "-fsyntax-only", folder / "controller.c"]
        subprocess.run(command, check=True, timeout=120)  # noqa: S603
    script = ["/bin/sh", folder / "evidence" / "check.sh"]
    subprocess.run(script, check=True, timeout=600, env={"PATH": alone(folder.parent)})  # noqa: S603


@pytest.fixture(scope="module")
def library(exported):
    return Library(exported[0])


def alone(folder, *others):
    """A path with gcc and others of the programs of a check."""
    programs = folder / "programs"
    programs.mkdir()
    for name in ("gcc", "as", "ld", "collect2", "sh", "rm", "dirname", *others):
        if path := shutil.which(name):
            (programs / name).symlink_to(path)
    return str(programs)


@pytest.mark.parametrize(
    ("source", "language"),
    [
        ("cfs/inspection_app.c", "c"),
        ("basilisk/inspectionController.c", "c"),
        ("simulink/controller_sfun.c", "c"),
    ],
)
def test_a_wrapper_fits_the_names_and_types_of_its_host(exported, source, language):
    folder, _, _ = exported
    path = folder / "wrappers" / source
    command = ["gcc", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", path]
    folders = [f"-I{each}" for each in (STUBS, folder, path.parent)]
    subprocess.run([*command, *folders], check=True, timeout=120)  # noqa: S603


def simulated(blocks, version, interface, flight, *, begins_s=0.0, step_s=SHORT.control_period_s, **starts):
    """The forces that an FMI block commands for a flight's inputs, from a time on."""
    path, period = blocks / f"fmi{version}.fmu", SHORT.control_period_s
    every = list(variables(interface))
    names = [each.name for each in every if each.causality == "input"]
    rows = np.zeros(len(flight.steps), [("time", "f8"), *((name, "f8") for name in names)])
    rows["time"] = begins_s + period * np.arange(len(rows))
    for name in names:
        field, _, number = name.rstrip("]").partition("[")
        rows[name] = flight.steps[field][:, int(number) - 1] if number else flight.steps[field]
    forces = [f"force_n[{axis}]" for axis in (1, 2, 3)]
    points = [each.name for each in every if each.variability == "fixed"]
    result = simulate_fmu(
        str(path),
        start_time=begins_s,
        stop_time=begins_s + period * len(rows),
        step_size=step_s,
        output_interval=step_s,
        input=rows,
        output=forces,
        fmi_type="CoSimulation",
        start_values=dict(zip(points, flight.start["counts"].astype(float), strict=True)) | starts,
    )
    return np.stack([result[name][1:] for name in forces], axis=1)


@pytest.mark.parametrize("begins_s", [0.0, 1234.0])
@pytest.mark.parametrize("version", [2, 3])
def test_an_fmi_block_commands_the_same(exported, blocks, version, begins_s):
    _, program, result = exported
    assert validate_fmu(str(blocks / f"fmi{version}.fmu")) == []
    (start,) = random_starts(1, seed=3)
    log = fly_logged(SHORT, program.controller, start)
    given = blocks, version, result.source.interface, recorded(program, start, log)
    commanded = simulated(*given, begins_s=begins_s)
    assert np.array_equal(commanded, log.force_commanded_n)
    assert np.any(commanded)
    bands = [each for each in result.source.interface.parameters if "dead_band" in each.name]
    deaf = {each.name: each.limits[1] for each in bands}
    assert not np.any(simulated(*given, begins_s=begins_s, **deaf))


@pytest.mark.parametrize("version", [2, 3])
def test_an_fmi_block_tells_units_and_ranges(exported, blocks, version):
    fields = exported[2].source.interface
    described = read_model_description(str(blocks / f"fmi{version}.fmu"))
    variables = {each.name.partition("[")[0]: each for each in described.modelVariables}
    for field in (*fields.step, *fields.parameters, *fields.output):
        if field.name == "period":
            continue
        variable = variables[field.name]
        assert (variable.unit or "") == field.unit
        assert variable.description == field.comment
        limits = [None if limit is None else float(limit) for limit in (variable.min, variable.max)]
        is_free = field.limits is None or field in fields.ages
        assert limits == ([None, None] if is_free else list(map(float, field.limits)))
    assert {variables[each.name].variability for each in fields.parameters} == {"tunable"}
    units = {each.unit for each in fields.step if each.unit}
    assert {unit.name for unit in described.unitDefinitions} >= units


@pytest.fixture(params=[2, 3])
def begun(request, blocks, tmp_path):
    """A block of a version that has begun, and the references of its numbers by name."""
    path, version = str(blocks / f"fmi{request.param}.fmu"), request.param
    described = read_model_description(path)
    block = {2: FMU2Slave, 3: FMU3Slave}[version](
        guid=described.guid if version == 2 else described.instantiationToken,
        modelIdentifier="controller",
        unzipDirectory=extract(path, str(tmp_path)),
        instanceName="begun",
    )
    block.instantiate()
    if version == 2:
        block.setupExperiment(startTime=0.0)
    block.enterInitializationMode()
    block.exitInitializationMode()
    yield version, block, {each.name: each.valueReference for each in described.modelVariables}
    block.freeInstance()


def test_an_fmi_block_holds_no_force_for_longer_than_a_period(begun):
    _, block, _ = begun
    for seconds in (SHORT.control_period_s, 0.1 * SHORT.control_period_s):
        block.doStep(0.0, seconds)
    for seconds in (3.0 * SHORT.control_period_s, np.nan):
        with pytest.raises(FMICallException, match="DoStep"):
            block.doStep(SHORT.control_period_s, seconds)


def test_an_fmi_block_goes_on_from_a_state_that_was_kept(exported, begun):
    _, program, _ = exported
    (start,) = random_starts(1, seed=3)
    flight = recorded(program, start, fly_logged(SHORT, program.controller, start))
    version, block, numbers = begun
    put, read = (block.setReal, block.getReal) if version == 2 else (block.setFloat64, block.getFloat64)

    def force(k):
        step = flight.steps[k]
        turn = program.world.mean_motion * program.world.control_period * k  # since the start's Sun, at 0
        sun = np.array([np.cos(turn), -np.sin(turn)])
        for name, values in (
            *(("position_m", step["position_m"]), ("velocity_m_s", step["velocity_m_s"])),
            ("sun_angle", sun),
        ):
            put([numbers[f"{name}[{axis}]"] for axis in range(1, 1 + len(values))], values.tolist())
        block.doStep(SHORT.control_period_s * k, SHORT.control_period_s)
        return read([numbers[f"force_n[{axis}]"] for axis in (1, 2, 3)])

    first = [force(k) for k in range(10)]
    state = block.getFMUState()
    then = [force(k) for k in range(10, 20)]
    kept = block.serializeFMUState(state)
    block.setFMUState(block.deserializeFMUState(kept))
    assert [force(k) for k in range(10, 20)] == then
    block.setFMUState(state)
    assert [force(k) for k in range(10, 20)] == then
    block.freeFMUState(state)
    assert np.any(first)
    assert np.any(then)


@pytest.mark.parametrize("version", [2, 3])
def test_an_fmi_block_does_not_begin_with_a_sun_that_is_none(blocks, version):
    with pytest.raises(FMICallException, match="ExitInitializationMode"):
        simulate_fmu(str(blocks / f"fmi{version}.fmu"), start_values={"sun_angle[1]": np.nan})


@pytest.fixture(scope="module")
def blocks(exported):
    folder = exported[0] / "wrappers" / "fmi"
    script = ["/bin/sh", folder / "build.sh"]
    subprocess.run(script, check=True, timeout=120, env=os.environ | {"LEVEL": "-O0"})  # noqa: S603
    return folder


def test_the_tutorial_goes_as_it_says(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    page = (DOCS / "how-to" / "fly-on-board.md").read_text(encoding="utf-8")
    tutorial = page.partition("\n## From rules to a Cortex-M\n")[2].partition("\n## ")[0]
    blocks = [(language, text) for language, _, text in BLOCK.findall(tutorial)]
    for (language, text), (_, expected) in itertools.pairwise(blocks):
        words = text.split()
        if language != "sh":
            continue
        if words[0] == "sh":
            for name, package in EMULATION.items():
                programs.program(name, package)
            subprocess.run(words, check=True, timeout=300)  # noqa: S603
        else:
            assert cli.main(words[3:]) == 0
            lines, tables, state = (int(number) for number in re.findall(r" (\d+)(?= |\n)", expected)[:3])
            row = f" | {lines:,} | {tables / 1e3:.1f} | {state / 1e3:.1f} | 0 |"
            assert row in page
        printed = capfd.readouterr().out
        assert re.sub(r"\d+ inst.*", "", printed) == re.sub(r"\d+ inst.*", "", expected)


EMULATION = {"arm-none-eabi-gcc": "gcc-arm-none-eabi", "qemu-system-arm": "qemu-system-arm"}
BAD = {
    "period": (1, (-1, 120, 2**31 - 1)),
    "position_m": (2, (np.nan, np.inf, -1e9, 0.0)),
    "velocity_m_s": (4, (np.nan, -np.inf, 1e6)),
    "attitude": (8, (np.nan, 2.0)),
    "sun_angle": (16, (np.nan, 2.0)),
    "sun_elevation": (16, (np.nan, np.inf)),
    "given_n": (32, (np.nan, np.inf)),
}


@pytest.mark.parametrize("field", BAD)
def test_an_input_out_of_range_says_which_and_ends_what_needs_it(exported, library, field):
    _, program, result = exported
    (start,) = random_starts(1, seed=2)
    log = fly_logged(SHORT, program.controller, start)
    flight = recorded(program, start, log)
    bit, values = BAD[field]
    interface = result.source.interface
    (described,) = (each for each in interface.step if each.name == field)
    for value in values:
        steps = flight.steps[:3].copy()
        steps[field][0] = value
        steps["is_given"][0] = field == "given_n"
        answers = library.answers(flight._replace(steps=steps))
        assert answers["status"][0] == bit
        is_needed = "rules" in interface.needed_by(described)
        assert np.array_equal(answers["force_n"][0], np.zeros(3) if is_needed else log.force_commanded_n[0])
        # the next step is as if nothing had been
        assert not np.any(answers["status"][1:])
    assert described.name == "attitude" or is_needed


def test_collision_avoidance_goes_on_without_what_it_does_not_need(tmp_path):
    guarded = mission(duration_s=1200.0, safety={"kind": "filter"})
    program = translate(guarded, controller("champion_27"))
    library = written(program, tmp_path)
    (start,) = random_starts(1, seed=5)
    flight = recorded(program, start, fly_logged(guarded, program.controller, start))
    closing, output = flight.steps[:1].copy(), np.zeros(1, OUTPUT)
    closing["position_m"], closing["velocity_m_s"] = [[0.0, 16.0, 0.0]], [[0.0, -0.1, 0.0]]
    lost = {"attitude": 0.0, "sun_angle": np.nan, "sun_elevation": np.nan, "period": 10**6, "given_n": np.nan}
    for field, value in lost.items():
        library.start(flight.start)
        step = closing.copy()
        step[field], step["is_given"] = value, field == "given_n"
        library.step(step, output)
        assert output["status"][0] == BAD[field][0]
        assert output["force_n"][0, 1] > 0.0  # away from the chief
        assert output["safety_limit"][0] == 1
    for field in ("position_m", "velocity_m_s"):
        step = closing.copy()
        step[field] = np.nan
        library.step(step, output)
        assert not np.any(output["force_n"])


@pytest.mark.parametrize("flag", ["-ffast-math", "-ffinite-math-only", "-mfpmath=387"])
def test_a_compiler_that_takes_liberties_with_doubles_is_refused(exported, flag):
    folder, _, _ = exported
    words = [programs.program("gcc", "gcc"), "-std=c99", flag, "-fsyntax-only", folder / "controller.c"]
    if flag.startswith("-m") and platform.machine() != "x86_64":
        pytest.skip("another processor has no such unit")
    done = subprocess.run(words, check=False, capture_output=True, text=True)  # noqa: S603
    assert done.returncode
    assert "compile " in done.stderr


def test_the_header_names_the_code_and_what_wrote_it(exported):
    folder, _, _ = exported
    header, code = ((folder / f"controller.{end}").read_bytes() for end in "hc")
    assert f'CONTROLLER_SHA256 "{sha256(code).hexdigest()}"' in header.decode()
    assert f'CONTROLLER_GENERATOR "fuzzy-spacecraft-inspection {product_version()}' in header.decode()


def test_constants_may_be_changed_in_flight(exported, library):
    _, program, _ = exported
    (start,) = random_starts(1, seed=3)
    log = fly_logged(SHORT, program.controller, start)
    flight = recorded(program, start, log)
    (_, designed), *_ = program.choices
    parameters = [1e3 if "dead_band" in name else designed[name] for name in program.parameters]
    deaf = library.answers(flight._replace(choices={0: 0}, parameters=[parameters]))
    assert np.any(log.force_commanded_n)
    assert not np.any(deaf["force_n"])


def test_what_has_no_rules_or_senses_the_truth_is_refused():
    with pytest.raises(NotTranslatableError, match="no rules"):
        translate(SHORT, named("lqr", SHORT))
    estimated = mission(guidance={"kind": "clusters"}, navigation={"mode": "fixes"})
    with pytest.raises(NotTranslatableError, match=r"guidance\.kind=centroid"):
        translate(estimated, controller("paper_champion"))


def test_the_translation_reads_the_formula_that_flies(exported, monkeypatch):
    folder, program, _ = exported
    monkeypatch.setattr(urgency, "MIN_PROJECTION_M", 3.25e-7)
    changed = sources(translate(SHORT, program.controller)).code
    assert "3.25e-07" in changed
    assert "3.25e-07" not in (folder / "controller.c").read_text()
