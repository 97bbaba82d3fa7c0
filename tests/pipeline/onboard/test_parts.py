"""Parts that an analyser takes one by one: they touch what is said of them, and faults in them are found."""

import re
import shutil
import subprocess

import pytest

from fis_tools.formats import serialize
from pipeline.flight.control.controller import from_fuzzy
from pipeline.onboard.export import export
from pipeline.onboard.parts import PARTS, parts_of
from pipeline.onboard.program import translate
from pipeline.onboard.source import sources
from tests import programs
from tests.fis_tools.sample_controllers import SHIPPED
from tests.pipeline.flight.cases import mission, random_starts

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc compiles what is written"),
]
MISSIONS = {"champion_27_rehearsed": {"safety": {"kind": "filter"}}, "champion_leo_rehearsed": {}}
#: calls each part with all else full of some octet, and prints what became of that and of what it may touch
TRIED = """
#include <stdio.h>

static double drawn(void)
{
    static unsigned int last = 12345U;

    last = (last * 1664525U) + 1013904223U;
    return (double)last / 4294967296.0;
}

static void note(const void *bytes, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        printf("%02x", ((const unsigned char *)bytes)[i]);
    }
    printf("\\n");
}

int main(int count, char **words)
{
    static struct controller state;
    const int octet = (count > 1) ? words[1][0] : 0;
"""


def flown(name):
    errors = {"navigation": {"mode": "fixes"}, "actuators": {"kind": "real"}}
    return mission(duration_s=600.0, **errors, **MISSIONS[name])


@pytest.fixture(scope="module", params=MISSIONS)
def program(request):
    return translate(flown(request.param), from_fuzzy(serialize.load(SHIPPED[request.param])))


def number(kind, limits):
    """Return C that draws a number in its range."""
    if kind == "double":
        least, most = limits or ("-1.0", "1.0")
        return f"({least} + (drawn() * (({most}) - ({least}))))"
    least, most = limits or ("0", "1")
    return f"({kind})floor({least} + (drawn() * (({most}) - ({least}) + 1)))"


def trying(part):
    """Return C that draws what a part shares, calls it, and prints what it may touch, then all else."""
    yield f"    memset(&state, 0, sizeof state); /* {part.name} */"
    yield from (f"    memset(&state.{each.name}, octet, sizeof state.{each.name});" for each in part.others)
    for each in part.shared:
        yield f"    for (size_t i = 0; i < sizeof state.{each.name} / sizeof({each.kind}); ++i) {{"
        yield f"        (({each.kind} *)&state.{each.name})[i] = {number(each.kind, each.limits)};"
        yield "    }"
    given = "".join(f", {number(each.kind, each.limits)}" for each in part.numbers)
    yield f"    {part.name}(&state{given});"
    yield from (
        f"    note(&state.{each.name}, sizeof state.{each.name});" for each in part.shared + part.private
    )
    yield '    printf("all else\\n");'
    yield from (f"    note(&state.{each.name}, sizeof state.{each.name});" for each in part.others)


def test_a_part_neither_reads_nor_writes_what_it_is_said_not_to(program, tmp_path):
    source = sources(program)
    parts = parts_of(source.code, source.members, program)
    is_kept_safe = program.mission.safety.kind == "filter"
    assert {part.name for part in parts} == set(PARTS) - {"assure"} | ({"assure"} if is_kept_safe else set())
    (tmp_path / "controller.h").write_text(source.header)
    for part in parts:
        text = "\n".join([source.code, TRIED, *trying(part), "    return 0;", "}", ""])
        (tmp_path / "tried.c").write_text(text)
        command = ["gcc", "-std=c99", "-O1", "-ffp-contract=off", "-o", "tried", "tried.c", "-lm"]
        subprocess.run(command, check=True, cwd=tmp_path, timeout=300)  # noqa: S603
        touched, rest = {}, {}
        for octet in ("a", "z"):
            done = [tmp_path / "tried", octet]
            printed = subprocess.run(done, check=True, capture_output=True, text=True)  # noqa: S603
            touched[octet], _, rest[octet] = printed.stdout.partition("all else\n")
        assert touched["a"] == touched["z"]
        assert set(rest["a"]) == {"6", "1", "\n"}
        assert set(rest["z"]) == {"7", "a", "\n"}
        assert {each.name for each in part.others} | {each.name for each in part.shared + part.private} == {
            *(f"parameters.{name}" for name in program.parameters),
            *source.members,
        }


def test_nothing_is_analysed_apart_where_nothing_is_flown_ahead():
    certain = translate(
        mission(duration_s=600.0), from_fuzzy(serialize.load(SHIPPED["champion_27_rehearsed"]))
    )
    source = sources(certain)
    assert parts_of(source.code, source.members, certain) == []


FAULTS = {
    "none": (r"\A", ""),
    "a member that belongs to others is written": (r"\n}\Z", "\n    state->plan_stage = 1;\n}"),
    "one is read": (r"\n}\Z", "\n    state->spent += state->plan_price;\n}"),
    "a range is left": (r"\n}\Z", "\n    state->commanded[0] = 9.0;\n}"),
    "an index": (r"\n}\Z", "\n    state->spent += state->belief_position[3 + now_k];\n}"),
}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    programs.program("frama-c", "frama-c-base")
    name, folder = "champion_27_rehearsed", tmp_path_factory.mktemp("parts") / "flight_software"
    translated = translate(
        mission(duration_s=600.0, navigation={"mode": "fixes"}), from_fuzzy(serialize.load(SHIPPED[name]))
    )
    export(translated, random_starts(1, seed=3), folder)
    return folder


def analysed(folder, line):
    """Return whether the folder's own script is content with one analysis alone."""
    script = folder / "evidence" / "prove.sh"
    text = re.sub(r"(?m)^analyse .*\n", "", script.read_text()).replace("rm -f parted.c", line)
    alone = script.with_name("alone.sh")
    alone.write_text(text)
    done = subprocess.run(["/bin/sh", alone], check=False, capture_output=True, text=True)  # noqa: S603
    assert "ANALYSIS SUMMARY" in done.stdout, done.stdout + done.stderr
    return done.returncode == 0


def entry(folder, name):
    """Return the line by which a part is analysed."""
    lines = (folder / "evidence" / "prove.sh").read_text().splitlines()
    return next(line for line in lines if line.endswith("parts.c") and f"analyse_{name} " in line)


@pytest.mark.parametrize("fault", FAULTS)
def test_the_analyser_finds_what_a_part_does_beyond_what_is_said_of_it(fault, exported, tmp_path):
    folder = shutil.copytree(exported, tmp_path / "faulty")
    code = (folder / "controller.c").read_text()
    (body,) = re.findall(r"(?ms)^static void move_ahead\(.*?^\}", code)
    faulty = re.sub(*FAULTS[fault], body, count=1)
    (folder / "controller.c").write_text(code.replace(body, faulty))
    assert analysed(folder, entry(folder, "move_ahead")) == (fault == "none")


@pytest.mark.parametrize(
    ("num_unseen", "period", "is_well"), [(3.0, 1, True), (1e3, 1, False), (3.0, -1, False)]
)
def test_the_analyser_finds_who_calls_a_part_with_what_it_does_not_count_on(
    num_unseen, period, is_well, exported, tmp_path
):
    folder = shutil.copytree(exported, tmp_path / "called")
    (folder / "evidence" / "any_input.c").write_text(
        '#include "../controller.h"\n'
        "void decide(struct controller *state, int now_k);\n"
        "static struct controller state;\n"
        f"int main(void) {{ state.num_unseen = {num_unseen}; decide(&state, {period}); return 0; }}\n"
    )
    line = re.sub(r"-main \w+ ", "", entry(folder, "decide"))
    assert analysed(folder, line) == is_well
