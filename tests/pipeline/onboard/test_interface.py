"""One description of the interface: headers, packets, pages and wrappers are of it, on every processor."""

import csv
import platform
import re
import shutil
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fis_tools.formats import serialize
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import REHEARSED
from pipeline.onboard.export import export
from pipeline.onboard.messages import APART_DEG, MODES, REQUIREMENTS, SOURCES, START, START_BITS
from pipeline.onboard.program import translate
from pipeline.onboard.recorded import OUTPUT, Library, recorded
from tests import programs
from tests.fis_tools.sample_controllers import SHIPPED
from tests.pipeline.flight.cases import mission, random_starts

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc compiles what is written"),
]
STUBS = Path(__file__).parent / "stubs"
GUARDED = mission(duration_s=1200.0, safety={"kind": "filter"})
OFF, SAFETY, RULES, PLAN = range(len(MODES))
#: compilers for processors that lay structures out otherwise or begin words at the other end, what runs their
#: programs, and the packages of both
OTHERS = {
    "i686-linux-gnu-gcc": ("qemu-i386", "gcc-i686-linux-gnu"),
    "arm-linux-gnueabihf-gcc": ("qemu-arm", "gcc-arm-linux-gnueabihf"),
    "powerpc-linux-gnu-gcc": ("qemu-ppc", "gcc-powerpc-linux-gnu"),
}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("interface")
    program = translate(GUARDED, from_fuzzy(serialize.load(SHIPPED["champion_27"])))
    return folder, program, export(program, random_starts(1, seed=1), folder)


@pytest.fixture(scope="module")
def interface(exported):
    return exported[2].source.interface


def members(header, structure):
    """Names and lengths of a structure of C, as its compiler sees them."""
    constants = dict(re.findall(r"#define (CONTROLLER_NUM_\w+) (\d+)", header))
    body = re.search(rf"struct {structure} \{{\n(.*?)\n\}};", header, re.DOTALL)[1]
    declared = re.findall(r"^\s+[a-z_ ]*?(\w+)(?:\[(\w+)\])?; ", body, re.MULTILINE)
    return [(name, int(constants.get(length, length or 1))) for name, length in declared]


def test_what_a_structure_has_is_described_and_named_by_every_wrapper(exported, interface):
    folder, _, _ = exported
    header = (folder / "controller.h").read_text()
    structures = set(re.findall(r"struct (controller_\w+(?:put))\b", header))
    assert structures == {f"controller_{name}" for name in interface.messages}
    wrappers = [path for path in (folder / "wrappers").iterdir() if path.is_dir()]
    assert len(wrappers) > 4
    for name, fields in interface.messages.items():
        listed = members(header, f"controller_{name}")
        assert listed == [(field.name, field.count) for field in fields]
        for wrapper in wrappers if name in {"step_input", "output"} else ():
            text = "\n".join(path.read_text() for path in wrapper.iterdir())
            assert [field for field, _ in listed if not re.search(rf"\b{field}\b", text)] == [], wrapper.name
    page = (folder / "interface.md").read_text()
    assert [
        field for fields in interface.messages.values() for field in fields if f"`{field.name}`" not in page
    ] == []


def octets_of(fields, values):
    """The octets of a message, by Python's own `struct` and NumPy's bits."""
    octets = b""
    for field, value in zip(fields, values, strict=True):
        letter = {"double": "d", "word": "I", "int": "i", "reason": "B"}.get(field.kind)
        numbers = np.atleast_1d(value)
        octets += (
            struct.pack(f">{len(numbers)}{letter}", *numbers) if letter else np.packbits(numbers).tobytes()
        )
    return octets


def drawn(fields, seed):
    """Numbers of each field of a message."""
    rng = np.random.default_rng(seed)

    def numbers(field):
        if field.kind == "double":
            last = float(rng.choice([-0.0, 5e-324]))
            return [*rng.normal(scale=1e3, size=field.count - 1).tolist(), last]
        lowest, past = {"flags": (0, 2), "reason": (0, 13), "word": (0, 2**32)}.get(
            field.kind, (-(2**31), 2**31)
        )
        return rng.integers(lowest, past, field.count).tolist()

    return [numbers(field) for field in fields]


def echo(interface):
    """A program that unpacks octets, prints their numbers, and packs them again."""
    lines = ['#include "packets.h"', "#include <stdio.h>", "#include <string.h>"]
    lines += ["int main(void)", "{", "    unsigned char octets[512], again[512];"]
    for name, fields in interface.messages.items():
        size = f"CONTROLLER_{name.upper()}_OCTETS"
        lines += [f"    static struct controller_{name} {name};"]
        lines += [f"    if (fread(octets, 1, {size}, stdin) != {size}) return 1;"]
        lines += [
            f"    controller_{name}_unpack(&{name}, octets);",
            f"    controller_{name}_pack(&{name}, again);",
        ]
        lines += [f"    if (memcmp(octets, again, {size}) != 0) return 2;"]
        for field in fields:
            letters = {"double": "%a", "word": "%u"}.get(field.kind, "%d")
            index = "[i]" if field.is_array else ""
            shown = f'(void)printf("{letters}\\n", {name}.{field.name}{index});'
            lines += [f"    for (int i = 0; i < {field.count}; ++i) {shown}"]
    return "\n".join([*lines, "    return 0;", "}", ""])


@pytest.mark.parametrize("compiler", ["gcc", *OTHERS])
def test_messages_are_the_same_octets_on_every_processor(exported, interface, compiler, tmp_path):
    folder, _, _ = exported
    runner = []
    if compiler in OTHERS:
        emulator, package = OTHERS[compiler]
        runner, compiler = [programs.program(emulator, "qemu-user")], programs.program(compiler, package)
    (tmp_path / "echo.c").write_text(echo(interface))
    files = [tmp_path / "echo.c", folder / "packets.c"]
    flags = ["-std=c99", "-static", "-Wall", "-Wextra", "-Werror", f"-I{folder}"]
    subprocess.run([compiler, *flags, "-o", tmp_path / "echo", *files], check=True)  # noqa: S603
    messages = [(fields, drawn(fields, seed)) for seed, fields in enumerate(interface.messages.values())]
    done = subprocess.run(  # noqa: S603
        [*runner, tmp_path / "echo"],
        input=b"".join(octets_of(*message) for message in messages),
        capture_output=True,
        check=True,
    )
    printed = [float.fromhex(text) if "x" in text else int(text) for text in done.stdout.decode().split()]
    expected = [number for _, values in messages for numbers in values for number in numbers]
    assert list(map(repr, printed)) == list(map(repr, expected))


def test_all_identities_are_in_telemetry(exported):
    folder, _, result = exported
    source = folder / "identity.c"
    source.write_text(
        '#include "packets.h"\n#include <stdio.h>\n'
        "int main(void) { unsigned char octets[CONTROLLER_IDENTITY_OCTETS];\n"
        "controller_identity_pack(octets); fwrite(octets, 1, sizeof octets, stdout); return 0; }\n"
    )
    command = ["gcc", "-std=c99", f"-I{folder}", "-o", folder / "identity", source, folder / "packets.c"]
    subprocess.run(command, check=True)  # noqa: S603
    octets = subprocess.run([folder / "identity"], capture_output=True, check=True).stdout  # noqa: S603
    identity = result.source.identity
    assert octets.hex() == "".join(identity[name] for name in ("code", "controller", "generator"))
    for version in (2, 3):
        described = (folder / "wrappers" / "fmi" / f"modelDescription{version}.xml").read_text()
        assert all(identity[name] in described for name in ("code", "controller", "generator", "licence"))


def test_the_data_sheet_of_cfs_has_the_fields_of_the_packets_in_their_order(exported, interface):
    folder, _, _ = exported
    sheet = ElementTree.parse(folder / "wrappers" / "cfs" / "inspection.xml")  # noqa: S314 - our own file
    space = {"": "http://www.ccsds.org/schema/sois/seds"}
    payloads = {
        tuple(entry.get("name") for entry in container.iterfind("EntryList/Entry", space))
        for container in sheet.iterfind(".//ContainerDataType", space)
    }
    assert {tuple(field.name for field in fields) for fields in interface.messages.values()} <= payloads


def test_each_requirement_stands_beside_the_code_that_serves_it(exported):
    folder, _, _ = exported
    rows = list(csv.DictReader((folder / "evidence" / "requirements.csv").read_text().splitlines()))
    assert {row["requirement"] for row in rows} == set(REQUIREMENTS)
    for row in rows:
        assert row["requirement"] in (folder / row["file"]).read_text().splitlines()[int(row["line"]) - 1]


@pytest.fixture(scope="module")
def flight(exported):
    _, program, _ = exported
    (start,) = random_starts(1, seed=5)
    return recorded(program, start, fly_logged(GUARDED, program.controller, start))


def answered(library, flight, **changes):
    """What is answered to a step of a flight that has begun, with some fields changed."""
    library.start(flight.start)
    step, output = flight.steps[:1].copy(), np.zeros(1, OUTPUT)
    for name, value in changes.items():
        step[name] = value
    library.step(step, output)
    return output[0]


@pytest.mark.skipif(platform.machine() != "x86_64", reason="F Prime's autocoder comes for x86-64 alone")
def test_the_component_of_f_prime_fires_what_the_function_does(
    exported, interface, library, flight, tmp_path
):
    """Its messages are those of F Prime's own autocoder; its base class and serializer are our stubs."""
    folder, stubs = exported[0], STUBS / "fprime"
    wrapper = folder / "wrappers" / "fprime"
    # the autocoder names headers by where a model stands
    models = [shutil.copy(path, tmp_path) for path in (stubs / "models.fpp", wrapper / "Controller.fpp")]
    autocoder = Path(sys.executable).parent
    subprocess.run([autocoder / "fpp-check", *models], check=True)  # noqa: S603
    names = ["-d", tmp_path, "-p", tmp_path, "-i", *models]
    subprocess.run([autocoder / "fpp-to-cpp", *names], check=True, cwd=tmp_path)  # noqa: S603
    objects = [tmp_path / f"{name}.o" for name in ("controller", "packets")]
    for path in objects:
        source = folder / path.with_suffix(".c").name
        command = ["gcc", "-std=c99", "-ffp-contract=off", "-c", "-o", path, source]
        subprocess.run(command, check=True)  # noqa: S603
    files = [path for kind in ("Array", "Enum", "Serializable") for path in tmp_path.glob(f"*{kind}Ac.cpp")]
    folders = [f"-I{path}" for path in (stubs, tmp_path, folder, wrapper)]
    files += [stubs / "flown.cpp", wrapper / "Controller.cpp", *objects]
    command = ["g++", "-std=c++14", *folders, "-o", tmp_path / "flown", *files]
    subprocess.run(command, check=True)  # noqa: S603
    steps = flight.steps[:30].copy()
    steps["age_sun"][3] = 99
    given = octets_of(interface.start, flight.start.item())
    given += b"".join(octets_of(interface.step, step.item()) for step in steps)
    done = subprocess.run([tmp_path / "flown"], input=given, capture_output=True, check=True)  # noqa: S603
    output = np.zeros(1, OUTPUT)
    expected = b""
    library.start(flight.start)
    for k in range(len(steps)):
        library.step(steps[k : k + 1], output)
        expected += octets_of(interface.output, output[0].item())
    size = len(octets_of(interface.output, output[0].item()))
    assert done.stdout[:-size] == expected
    stale = np.zeros(1, OUTPUT)
    stale["code"], stale["status"], stale["reason"] = output["code"], 256, 9
    assert done.stdout[-size:] == octets_of(interface.output, stale[0].item())


@pytest.fixture(scope="module")
def library(exported):
    return Library(exported[0])


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.name)
def test_an_input_serves_until_it_is_too_old_and_what_needs_it_gives_way(library, flight, interface, source):
    (age,) = (age for age in interface.ages if age.name == f"age_{source.name}")
    oldest = age.limits[1]
    for well in (0, oldest):
        answer = answered(library, flight, **{age.name: well})
        assert (answer["status"], answer["mode"]) == (0, RULES)
    for old in (oldest + 1, -1, 2**31 - 1):
        answer = answered(library, flight, **{age.name: old})
        assert answer["status"] == source.bit
        needing = {name for name, bits in interface.needs.items() if age.bit in bits}
        expected = OFF if "safety" in needing else SAFETY if "rules" in needing else RULES
        assert answer["mode"] == expected


def test_a_position_that_is_frozen_grows_old(library, flight, interface):
    (age,) = (age for age in interface.ages if age.name == "age_navigation")
    library.start(flight.start)
    steps, output, modes = flight.steps[:8].copy(), np.zeros(1, OUTPUT), []
    steps["position_m"][2:7], steps["velocity_m_s"][2:7] = steps["position_m"][2], steps["velocity_m_s"][2]
    for k in range(8):
        for _ in range(2):  # a period that is stepped twice is no older
            library.step(steps[k : k + 1], output)
            assert output["status"][0] == (age.limits[1] < k - 2 < 5) * 512
        modes.append(output["mode"][0])
    assert modes[:2] == [RULES, RULES]
    assert modes[6:] == [OFF, RULES]


def test_with_an_old_sun_the_layer_still_brakes(library, flight):
    closing = {"position_m": [0.0, 16.0, 0.0], "velocity_m_s": [0.0, -0.1, 0.0], "age_sun": 1000}
    answer = answered(library, flight, **closing)
    assert answer["mode"] == SAFETY
    assert answer["force_n"][1] > 0.0


def test_a_given_force_needs_no_sun_but_a_position(library, flight):
    push = {"is_given": 1, "given_n": [0.01, 0.0, -0.02]}
    for lost in ({"sun_angle": np.nan}, {"age_sun": 99}, {"age_points": 99}):
        answer = answered(library, flight, **push, **lost)
        assert answer["mode"] == PLAN
        np.testing.assert_array_equal(answer["force_n"], push["given_n"])
        assert (answer["reason"] == REHEARSED).all()
    assert answered(library, flight, **push, position_m=np.nan)["mode"] == OFF


@pytest.fixture(scope="module", params=[False, True], ids=["in plane", "tilted"])
def restart(request, tmp_path_factory):
    """The C of a controller, and a flight of it, with the Sun in the orbit plane or not."""
    program = translate(GUARDED, from_fuzzy(serialize.load(SHIPPED["champion_27"])), is_tilted=request.param)
    folder, (start,) = tmp_path_factory.mktemp("restart"), random_starts(1, seed=5)
    start = replace(start, sun_elevation_rad=0.4 * request.param)
    exported = export(program, [start], folder)
    log = fly_logged(GUARDED, program.controller, start)
    return exported.source.interface, Library(folder), recorded(program, start, log), program.world


def restarted(library, flight, sample, **given):
    """What a start with some fields changed returns, and what is answered to a later step."""
    start, output = flight.start.copy(), np.zeros(1, OUTPUT)
    for name, value in given.items():
        start[name] = value
    status = library.start(start)
    library.step(flight.steps[sample : sample + 1], output)
    return status, output[0]


def test_a_start_in_the_middle_of_a_flight_goes_on_with_it(restart):
    _, library, flight, _ = restart
    whole = library.answers(flight)
    assert not np.any(whole["status"])
    for sample in range(0, len(whole), 7):
        status, answer = restarted(library, flight, sample)
        assert (status, answer["status"], answer["mode"]) == (0, 0, RULES)
        np.testing.assert_array_equal(answer["inferred_n"], whole["inferred_n"][sample])


def misgiven(flight, field, sample):
    """A field of a start that does not go with a step: turned by ten degrees, or without a point."""
    value = flight.start[field.name]
    if field.kind == "flags":
        return value & (np.arange(len(value)) != np.flatnonzero(flight.steps["unseen"][sample])[0])
    assert field.is_unit
    cosine, sine = np.cos(np.radians(10.0)), np.sin(np.radians(10.0))
    return cosine * value[0] - sine * value[1], cosine * value[1] + sine * value[0]


@pytest.mark.parametrize("field", START, ids=lambda field: field.name)
def test_each_input_of_a_start_is_held_against_the_steps_that_follow(restart, field):
    interface, library, flight, _ = restart
    (described,) = (each for each in interface.start if each.name == field.name)
    number, _ = START_BITS[field.step_bit]
    assert field.step_bit in interface.needs["rules"]
    assert not {field.step_bit} & {*interface.needs["plan"], *interface.needs["safety"]}
    for sample in (0, 40):
        status, answer = restarted(library, flight, sample, **{field.name: misgiven(flight, field, sample)})
        if described.in_plane:  # then it is refused at once
            assert (status, answer["status"], answer["mode"]) == (16, 64, OFF)
        else:
            assert (status, answer["status"], answer["mode"]) == (0, number, SAFETY)


def test_the_sun_of_the_restart_is_not_taken_for_that_of_the_first_period(restart):
    _, library, flight, world = restart
    for sample in range(0, 30):
        now = {name: flight.steps[name][sample] for name in ("sun_angle", "sun_elevation")}
        first = np.append(now["sun_elevation"][0] * now["sun_angle"], now["sun_elevation"][1])
        turn = -world.mean_motion * world.control_period * sample  # Hill axes turn about the third one
        turned = Rotation.from_euler("z", turn).apply(first)
        off_deg = np.degrees(np.arccos(min(1.0, float(first @ turned))))
        assert restarted(library, flight, sample, **now)[1]["status"] == (off_deg > APART_DEG) * 8192
    assert off_deg > APART_DEG


def test_a_start_is_not_blamed_for_what_a_step_lacks(restart):
    interface, library, flight, _ = restart
    for field in interface.start:
        if field.in_plane:
            continue
        age = "age_points" if field.name == "counts" else "age_sun"
        steps = flight.steps.copy()
        steps[age] = 99
        wrong = {field.name: misgiven(flight, field, 0)}
        _, answer = restarted(library, flight._replace(steps=steps), 0, **wrong)
        (old,) = (each.bit for each in SOURCES if f"age_{each.name}" == age)
        assert answer["status"] == old


def test_a_parameter_is_changed_by_number_and_read_back(exported, interface, library, flight):
    change, changed = (
        np.zeros(1, np.dtype(row, align=True))
        for row in (
            [("parameter", "i4"), ("value", "f8")],
            [("parameter", "i4"), ("status", "i4"), ("value", "f8")],
        )
    )
    library.start(flight.start)

    def answer(number, value):
        change["parameter"], change["value"] = number, value
        library.change(change, changed)
        return tuple(changed[0])

    for number, parameter in enumerate(interface.parameters):
        lowest, highest = parameter.limits
        assert answer(number, highest) == (number, 0, highest)
        for value in (np.nan, np.inf, lowest - 1.0, 2.0 * highest):
            assert answer(number, value) == (number, 128, highest)
        assert answer(number, parameter.start) == (number, 0, parameter.start)
    for number in (-1, len(interface.parameters)):
        assert answer(number, 0.0) == (number, 128, 0.0)
    assert len(interface.parameters) > 3
    output = np.zeros(1, OUTPUT)
    library.step(flight.steps[:1], output)
    assert output["status"][0] == 0
