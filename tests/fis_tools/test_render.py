"""What the pictures say, read back from their axes."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from sample_controllers import force_x_system, force_z_system, general_controller

from fis_tools.inference import infer
from fis_tools.membership import sample_terms
from fis_tools.model import FuzzySystem, Gaussian, Term, Variable, table_rules
from fis_tools.render import memberships, rule_matrix, surface_map, system_figures


def test_membership_functions_are_drawn_named_and_told_apart_without_colour() -> None:
    variable = force_x_system().inputs[0]
    ax = memberships(variable, Figure().subplots())
    assert [text.get_text() for text in ax.texts] == [term.name for term in variable.terms]
    for line, function in zip(ax.lines, sample_terms(variable), strict=True):
        np.testing.assert_array_equal(line.get_xdata(), variable.universe)
        np.testing.assert_array_equal(line.get_ydata(), function)
    assert len({line.get_linestyle() + str(line._dash_pattern) for line in ax.lines}) == 5  # type: ignore[attr-defined]
    assert ax.get_xlabel() == "distance (m)"
    assert ax.get_xlim() == (0.0, 200.0)


def test_names_of_terms_do_not_run_into_one_another() -> None:
    names = ("rather far to the left", "a little to the left", "just about ahead", "to the right")
    terms = tuple(Term(name, Gaussian(0.1 * place, 0.1)) for place, name in enumerate(names))
    figure = Figure(figsize=(5, 2), layout="constrained")
    ax = memberships(Variable("angle", "rad", 0.0, 1.0, terms), figure.subplots())
    figure.canvas.draw()
    boxes = [text.get_window_extent() for text in ax.texts]
    for place, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[place + 1 :])
        assert box.y1 <= figure.bbox.y1


def test_the_rule_matrix_holds_every_consequent_at_its_place() -> None:
    system = force_x_system()
    ax = rule_matrix(system, Figure().subplots())
    words = [text.get_text() for text in ax.texts]
    assert words == [rule.consequents[0].term for rule in system.rules]
    # the rule of the third distance and the fourth velocity stands at column 3, row 2
    assert ax.texts[2 * 5 + 3].get_position() == (3, 2)
    assert [label.get_text() for label in ax.get_xticklabels()][4] == "towards\nfast"
    assert ax.get_ylabel() == "distance"


def test_brightness_alone_orders_the_terms_and_words_stay_readable() -> None:
    system = force_x_system()
    ax = rule_matrix(system, Figure().subplots())
    image = np.asarray(ax.images[0].get_array())
    brightness = image @ (0.299, 0.587, 0.114)
    place = {term.name: index for index, term in enumerate(system.outputs[0].terms)}
    order = np.array([place[text.get_text()] for text in ax.texts]).reshape(5, 5)
    for lower in range(4):
        assert brightness[order == lower].max() + 0.08 < brightness[order == lower + 1].min()
    for text, cell in zip(ax.texts, brightness.ravel(), strict=True):
        assert abs({"white": 1.0, "black": 0.0}[str(text.get_color())] - cell) > 0.45


def test_a_third_input_needs_a_term() -> None:
    system = force_z_system()
    ax = rule_matrix(system, Figure().subplots(), {"eta_u": "right"})
    assert [text.get_text() for text in ax.texts] == [r.consequents[0].term for r in system.rules[30:]]
    with pytest.raises(ValueError, match="for one term of 'eta_u'; fix it to one of left, ahead, right"):
        rule_matrix(system, Figure().subplots())
    with pytest.raises(ValueError, match="no outer input 'distance'"):
        rule_matrix(system, Figure().subplots(), {"distance": "near", "eta_u": "left"})


def test_a_rule_base_that_is_no_table_has_no_matrix() -> None:
    with pytest.raises(ValueError, match="no full table"):
        rule_matrix(general_controller().systems[0], Figure().subplots())


def test_one_input_makes_one_row() -> None:
    system = force_x_system()
    inputs = system.inputs[1:]
    system = FuzzySystem("row", inputs, system.outputs, table_rules(inputs, system.outputs[0], ["ZE"] * 5))
    ax = rule_matrix(system, Figure().subplots())
    assert len(ax.texts) == 5
    assert [name for name, _ in system_figures(system)] == ["memberships", "rules"]


def test_the_surface_map_lies_as_the_rule_matrix_does() -> None:
    system = force_x_system()
    ax = surface_map(system, Figure().subplots(), num_points=3)
    values = np.asarray(ax.images[0].get_array())
    # up the y axis the distance grows, along x the velocity
    assert ax.get_ylabel() == "distance (m)"
    assert values[2, 0] == pytest.approx(infer(system, np.array([200.0, -0.3])).values[0], abs=1e-13)
    assert values[0, 2] == pytest.approx(infer(system, np.array([0.0, 0.3])).values[0], abs=1e-13)
    assert ax.images[0].get_clim() == (values.min(), values.max())
    assert ax.images[0].origin == "lower"


def test_a_flat_surface_is_drawn_without_contours() -> None:
    system = force_x_system()
    output = system.outputs[0]
    flat = replace(system, rules=table_rules(system.inputs, output, ["ZE"] * 25))
    assert not surface_map(flat, Figure().subplots(), num_points=5).texts


@pytest.mark.parametrize(
    ("system", "expected"),
    [
        (force_x_system(), {"memberships": 3, "rules": 1, "surface": 2}),
        (force_z_system(), {"memberships": 4, "rules": 3, "surface": 4}),
        (general_controller().systems[0], {"memberships": 4, "surface-heat": 2, "surface-vent": 2}),
    ],
)
def test_figures_of_a_system(system: FuzzySystem, expected: dict[str, int]) -> None:
    figures = dict(system_figures(system))
    assert {name: len(figure.axes) for name, figure in figures.items()} == expected
    for figure in figures.values():
        figure.canvas.draw()
