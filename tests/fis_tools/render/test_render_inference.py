"""An inference drawn step by step: the numbers are those of the inference."""

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fis_tools.engines.inference import infer
from fis_tools.render.inference import conclusion_panel, inference_figure, output_panel, statement_panel
from tests.fis_tools.render.picture_systems import autopilot_system, room_system, seen_words
from tests.fis_tools.sample_controllers import force_x_system


def title(ax: Axes) -> str:
    return ax.get_title(loc="left").replace("\n", " ").replace("\xa0", " ")


def test_a_statement_shows_how_far_the_input_fulfils_it() -> None:
    system = force_x_system()
    step = infer(system, np.array([80.0, 0.05]))
    ax = statement_panel(step, system.rules[7], system.inputs[0], Figure().subplots())
    degree = step.memberships[0][1]
    assert title(ax) == f"near {degree:.2f}"
    marks = [line.get_xydata().tolist() for line in ax.lines if line.get_marker() == "o"]
    assert marks == [[[80.0, degree]]]
    top = max(path.vertices[:, 1].max() for path in ax.collections[0].get_paths())
    assert top == pytest.approx(degree)


def test_a_denied_term_is_drawn_turned_over_and_an_input_not_asked_for_is_empty() -> None:
    system = room_system()
    step = infer(system, np.array([18.0, 2.0]))
    ax = statement_panel(step, system.rules[0], system.inputs[0], Figure().subplots())
    cold, hot = step.memberships[0]
    assert title(ax) == f"cold {cold:.2f}, not hot {1 - hot:.2f}"
    denied = ax.lines[3].get_ydata()
    assert denied[0] == 1.0
    assert denied[-1] == 0.0
    empty = statement_panel(step, system.rules[1], system.inputs[1], Figure().subplots())
    assert title(empty) == "any"
    assert not empty.lines


def test_a_conclusion_is_cut_at_strength_times_weight() -> None:
    system = room_system()
    ax = conclusion_panel(system.outputs[1], system.rules[0].consequents, 0.8, Figure().subplots())
    assert title(ax) == "open 0.80 × 0.25 = 0.20"
    top = max(path.vertices[:, 1].max() for path in ax.collections[0].get_paths())
    assert top == pytest.approx(0.2)


def test_the_output_is_the_aggregate_with_its_number() -> None:
    system = force_x_system()
    output = infer(system, np.array([80.0, 0.05])).outputs[0]
    ax = output_panel(output, system.defuzzifier, Figure().subplots())
    (outline,) = (line for line in ax.lines if len(line.get_xdata()) == len(output.universe))
    np.testing.assert_array_equal(outline.get_ydata(), output.aggregated)
    assert title(ax) == f"force_x = {output.value:.6g} N, centre of area"
    (mark,) = (line for line in ax.lines if line.get_marker() == "^")
    assert mark.get_xdata() == [output.value]


def test_a_figure_shows_the_rules_that_fire_the_strongest_first_and_counts_the_rest() -> None:
    system = force_x_system()
    step = infer(system, np.array([80.0, 0.05]))
    figure = inference_figure(step, most_rules=3)
    words = [text.get_text().replace("\n", " ") for text, _ in seen_words(figure)]
    order = np.argsort(-step.firing_strengths, kind="stable")
    told = [word for word in words if word.startswith("rule ")]
    starts = [
        f"rule {place + 1} fires at {step.firing_strengths[place]:.2f}: If distance" for place in order[:3]
    ]
    assert [word[: len(start)] for word, start in zip(told, starts, strict=True)] == starts
    firing = int(np.count_nonzero(step.firing_strengths))
    assert f"{firing - 3} more rules fire, at {step.firing_strengths[order[3]]:.2g} or less" in words
    assert any(word.replace("\xa0", " ").startswith("distance = 80 m: ") for word in words)
    assert any(word.startswith("velocity_body_x = 0.05 m/s: ") for word in words)
    # two inputs, three rules of three panels, one output
    assert len(figure.axes) == 2 + 3 * 3 + 1


def test_two_outputs_stand_side_by_side() -> None:
    step = infer(room_system(), np.array([18.0, 2.0]))
    figure = inference_figure(step)
    titles = [title(ax) for ax in figure.axes[-2:]]
    assert titles[0] == f"heat = {step.values[0]:.6g} kW, bisector of the area"
    assert titles[1].startswith(f"vent = {step.values[1]:.6g}, ")
    assert "no other rule fires" in [text.get_text() for text in figure.texts]


def test_where_nothing_fires_the_default_is_told() -> None:
    system = room_system()
    step = infer(system, np.array([18.0, 16.0]))
    silent = infer(system, np.array([18.0, 16.0]))
    assert step.values.tolist() == silent.values.tolist()
    narrow = autopilot_system()
    far = infer(narrow, np.array([0.0, 0.0, 0.0]))
    assert far.firing_strengths.max() == 1.0
    output = silent.outputs[0]
    quiet = type(output)(
        output.variable, np.zeros(2), output.universe, np.zeros(len(output.universe)), 0.5, is_default=True
    )
    ax = output_panel(quiet, "centroid", Figure().subplots())
    assert title(ax) == "heat = 0.5 kW, the default: no rule fires"
