"""The tables of a small controller in C: inference reads whole rows of them, and never beyond their ends."""

import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from fis_tools.engines.inference import infer
from fis_tools.formats import serialize
from fis_tools.model import Consequent, Is, Rule, Term
from fis_tools.model.shapes import Triangular
from pipeline.flight.control.controller import from_fuzzy
from pipeline.onboard.program import translate
from pipeline.onboard.source import sources
from tests.fis_tools.sample_controllers import SHIPPED
from tests.pipeline.flight.cases import mission

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc compiles what is written"),
]
#: infers from numbers over the whole of an input
MAIN = """
#include <stdio.h>
int main(void)
{
    static struct controller state;
    static struct controller_start_input start;
    (void)controller_start(&state, &start);
    for (int i = 0; i <= 40; ++i) {
        state.scratch_inputs[0] = 0.05 * i - 1.0;
        infer(&state);
        (void)printf("%a ", state.scratch_output);
        infer_2(&state);
        (void)printf("%a\\n", state.scratch_output);
    }
    return 0;
}
"""
SANITIZED = ("-fsanitize=bounds,undefined", "-fsanitize-undefined-trap-on-error")


def outputs_of(count):
    """Terms of an output, evenly apart; the outermost have their peaks at its ends."""
    width = 2.0 / (count - 1)
    peaks = np.linspace(-1.0, 1.0, count)
    return tuple(
        Term(f"t{number}", Triangular(peak - width, peak, peak + width)) for number, peak in enumerate(peaks)
    )


def small(num_points, num_terms):
    """A controller of two axes, with an input and two rules each, which conclude the outermost terms."""
    shipped, systems = serialize.load(SHIPPED["champion_27"]), []
    senses = (Term("low", Triangular(-2.0, -1.0, 1.0)), Term("high", Triangular(-1.0, 1.0, 2.0)))
    for system in shipped.systems[:2]:
        signal, force = (
            replace(each, minimum=-1.0, maximum=1.0, terms=terms, num_points=num_points)
            for each, terms in ((system.inputs[0], senses), (system.outputs[0], outputs_of(num_terms)))
        )
        rules = tuple(
            Rule(Is(signal.name, sense), (Consequent(force.name, f"t{concluded}"),))
            for sense, concluded in (("low", 0), ("high", num_terms - 1))
        )
        systems.append(replace(system, inputs=(signal,), outputs=(force,), rules=rules))
    return replace(shipped, systems=tuple(systems), provenance={})


@pytest.mark.parametrize(("num_points", "num_terms"), [(9, 2), (9, 5), (11, 5), (17, 7), (101, 3)])
def test_inference_by_few_points_reads_inside_its_tables(num_points, num_terms, tmp_path):
    controller = small(num_points, num_terms)
    source = sources(translate(mission(duration_s=300.0), from_fuzzy(controller)))
    (tmp_path / "controller.h").write_text(source.header)
    (tmp_path / "main.c").write_text(source.code + MAIN)
    program = tmp_path / "main"
    command = ["gcc", "-std=c99", "-O1", "-ffp-contract=off", "-w", *SANITIZED]
    subprocess.run([*command, "-o", program, tmp_path / "main.c", "-lm"], check=True, timeout=120)  # noqa: S603
    done = subprocess.run([program], check=False, capture_output=True, text=True, timeout=60)  # noqa: S603
    assert done.returncode == 0  # it ends where an index leaves its array
    answers = np.array([[float.fromhex(word) for word in line.split()] for line in done.stdout.splitlines()])
    sensed = 0.05 * np.arange(41) - 1.0
    for column, system in enumerate(controller.systems):
        expected = [infer(system, {system.inputs[0].name: x}).outputs[0].value for x in sensed.tolist()]
        np.testing.assert_allclose(answers[:, column], expected, rtol=1e-9, atol=1e-12)
