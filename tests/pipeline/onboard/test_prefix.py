"""Names of an export that begin as one likes, and what an export says that it is."""

import re
import shutil
import subprocess
from functools import cache
from hashlib import sha256

import numpy as np
import pytest

from fis_tools.formats import serialize
from fis_tools.formats.serialize import content_hash
from pipeline.command_line import cli
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.fly.simulation import fly_logged
from pipeline.onboard.export import export
from pipeline.onboard.program import translate
from pipeline.onboard.recorded import Library, recorded
from pipeline.run.maker import git_revision, sources_hash
from tests.fis_tools.sample_controllers import SHIPPED
from tests.pipeline.flight.cases import mission, random_starts

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc compiles what is written"),
]
SHORT = mission(duration_s=600.0)
#: two controllers that fly in one program, by what their names begin with
BOTH = {"champion_27": "inspection", "champion_81": "spare"}
TOGETHER = """
#include "inspection/controller.h"
#include "spare/controller.h"

static struct inspection first;
static struct spare second;

int main(void)
{
    struct inspection_step_input input = {0};
    struct spare_step_input other = {0};
    struct inspection_output output;
    struct spare_output answer;

    inspection_step(&first, &input, &output);
    spare_step(&second, &other, &answer);
    return (output.status == answer.status) && (INSPECTION_NUM_POINTS == SPARE_NUM_POINTS) &&
           (INSPECTION_ID != SPARE_ID) && (output.reason[0] == INSPECTION_REASON_INPUT) ? 0 : 1;
}
"""


@cache
def program(name):
    return translate(SHORT, from_fuzzy(serialize.load(SHIPPED[name])))


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("both")
    results = {
        name: export(program(name), random_starts(1, seed=1), folder / prefix, prefix)
        for name, prefix in BOTH.items()
    }
    return folder, results


def test_two_exports_link_into_one_program(exported):
    folder, results = exported
    assert all(result.num_different == 0 for result in results.values())
    (folder / "both.c").write_text(TOGETHER)
    sources = [folder / "both.c", *(folder / prefix / "controller.c" for prefix in BOTH.values())]
    flags = ["-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror"]
    command = ["gcc", *flags, "-o", folder / "both", *sources, "-lm"]
    subprocess.run(command, check=True)  # noqa: S603
    assert subprocess.run([folder / "both"], check=False).returncode == 0  # noqa: S603


def test_no_name_that_others_see_begins_otherwise(exported):
    folder, _ = exported
    for path in (folder / "spare").rglob("*.[ch]*"):
        names = re.findall(r"\b(?:controller_[a-z]\w*|CONTROLLER_\w+|REASON_\w+)", path.read_text())
        assert names == [], path
    check = ["/bin/sh", folder / "spare" / "evidence" / "check.sh"]
    path = folder / "programs"
    path.mkdir()
    for name in ("gcc", "as", "ld", "collect2", "sh", "rm", "dirname"):
        if program_path := shutil.which(name):
            (path / name).symlink_to(program_path)
    subprocess.run(check, check=True, env={"PATH": str(path)})  # noqa: S603


def test_a_prefix_changes_no_command(exported):
    folder, _ = exported
    (start,) = random_starts(1, seed=5)
    log = fly_logged(SHORT, program("champion_27").controller, start)
    flight = recorded(program("champion_27"), start, log)
    answers = Library(folder / "inspection", prefix="inspection").answers(flight)
    np.testing.assert_array_equal(answers["force_n"], log.force_commanded_n)
    assert np.any(log.force_commanded_n)


def test_header_and_readme_say_what_was_made_of_what(exported):
    folder, _ = exported
    for name, prefix in BOTH.items():
        header, readme = ((folder / prefix / file).read_text() for file in ("controller.h", "README.md"))
        defined = dict(re.findall(rf'#define {prefix.upper()}_(\w+) "?([^"\n]*?)"?\n', header))
        code = sha256((folder / prefix / "controller.c").read_bytes()).hexdigest()
        rules = content_hash(serialize.load(SHIPPED[name]))
        assert (defined["SHA256"], defined["RULES_SHA256"]) == (code, rules)
        assert defined["GENERATOR_SHA256"] == sources_hash()
        assert (defined["REVISION"], defined["LICENCE"]) == (git_revision() or "", "MIT")
        assert defined["ID"] == f"0x{code[:8]}U"
        assert all(digest in readme for digest in (code, rules, sources_hash()))


@pytest.mark.parametrize("prefix", ["", "2nd", "double", "Spare", "a-b", "x" * 40, "a;b"])
def test_a_prefix_that_is_no_name_is_refused(prefix, tmp_path, capsys):
    words = ["export_c", "controller=champion_27", "-o", str(tmp_path / "new"), f"--prefix={prefix}"]
    assert cli.main(words) == 2
    assert "names of C cannot begin with" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()
