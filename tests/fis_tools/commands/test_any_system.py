"""Every command works on any system, of everything that is registered, or says in a sentence why not."""

import json
import re

import numpy as np
import pytest

from fis_tools.__main__ import MISTAKE, main
from fis_tools.commands import COMMANDS
from fis_tools.formats import serialize
from fis_tools.formats.files import ONE_SYSTEM, WHOLE
from tests import night
from tests.fis_tools.agreement import drawn
from tests.fis_tools.formats.exchange.systems import alone

#: words after each command, in several ways; in braces the file, inputs, an output, and a folder
WORDS = {
    "show": ["{file}"],
    "plot": ["{file} -o {folder}/figures"],
    "surface": ["{file}", "{file} -o {folder}/surface.png"],
    "export": [f"{{file}} --format {form} -o {{folder}}/{form}" for form in (*WHOLE, *ONE_SYSTEM)],
    "import": ["{file} -o {folder}/imported.json"],
    "audit": ["{file}", "{file} --json"],
    "explain": [
        "{file} --inputs {inputs}",
        "{file} --inputs {inputs} --json",
        "{file} --inputs {inputs} --crossing {output}=0.1",
    ],
    "bounds": ["{file} --boxes 200", "{file} --boxes 200 --ask {output}>0"],
    "diff": ["{file} {file}", "{file} {file} -o {folder}/diff.html"],
    "simplify": ["{file} -o {folder}/simpler.json"],
    "review": ["{file} -o {folder}/review.html"],
}
#: those that are about flights, tables or programs beside a controller
OF_MORE = {"domain", "learn", "edit"}
#: numbers of systems with which a command once ended in an error: outputs without a value, faint degrees
ONCE_BROKEN = (9, 12, 13, 31, 34, 40, 46, 90)


def test_every_command_that_takes_a_controller_is_tried():
    assert {*WORDS, *OF_MORE} == {*COMMANDS}


@pytest.mark.slow
@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("number", range(150) if night.IS_WHOLE else ONCE_BROKEN)
def test_a_drawn_system_is_answered_by_every_command(number, tmp_path, capsys):
    generator = np.random.default_rng([17, number])
    system = drawn.system(generator, "drawn")
    (tmp_path / "drawn.yaml").write_text(serialize.dump_yaml(alone(system)), encoding="utf-8")
    row = drawn.points(system, generator, 1)[0]
    row = np.where(np.isfinite(row), row, 0.5).tolist()
    inputs = ",".join(
        f"{variable.name}={value!r}" for variable, value in zip(system.inputs, row, strict=True)
    )
    given = {
        "file": tmp_path / "drawn.yaml",
        "inputs": inputs,
        "output": system.outputs[0].name,
        "folder": tmp_path,
    }
    for command, ways in WORDS.items():
        for way in ways:
            words = [command, *(word.format(**given) for word in way.split())]
            code = main(words)
            printed = capsys.readouterr()
            assert code in (0, MISTAKE), words
            assert "Traceback" not in printed.err, words
            assert code == 0 or printed.err.strip(), words
            # tables of numbers have such values, sentences have words for them
            is_told = command not in ("surface", "export") and "--json" not in words
            assert not (is_told and re.search(r"\bnan\b", printed.out)), words
            if "--json" in words and code == 0:
                json.loads(printed.out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
