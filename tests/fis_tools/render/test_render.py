"""Membership functions and whole figures: what they say, read back, and that words keep apart."""

from math import exp

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from fis_tools import render
from fis_tools.engines.inference import infer
from fis_tools.model import FuzzySystem, Gaussian, Term, Variable
from fis_tools.model.variables import sample_terms
from fis_tools.render import DARK, LIGHT, Theme, memberships, system_figures
from fis_tools.render.theme import contrast
from tests.fis_tools.render.picture_systems import (
    autopilot_system,
    collisions,
    nine_terms_system,
    one_input_system,
    room_system,
    seen_words,
)
from tests.fis_tools.sample_controllers import force_x_system, force_z_system


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


def test_names_stand_over_their_peaks_and_do_not_run_into_one_another() -> None:
    names = ("rather far to the left", "a little to the left", "just about ahead", "to the right")
    terms = tuple(Term(name, Gaussian(0.1 + 0.1 * place, 0.1)) for place, name in enumerate(names))
    figure = Figure(figsize=(5, 2), layout="constrained")
    ax = memberships(Variable("angle", "rad", 0.0, 1.0, terms), figure.subplots())
    assert collisions(figure) == []
    peaks = [ax.transData.transform((0.1 + 0.1 * place, 1.0)) for place in range(4)]
    for text, (x, y) in zip(ax.texts, peaks, strict=True):
        box = text.get_window_extent()
        assert box.x0 <= x <= box.x1
        assert box.y0 >= y


def test_a_value_is_marked_with_its_memberships_the_greatest_first() -> None:
    variable = force_x_system().inputs[0]
    ax = memberships(variable, Figure().subplots(), 60.0)
    means, standard_deviation = (0.0, 50.0, 100.0, 150.0, 200.0), 25.0
    expected = [exp(-((60.0 - mean) ** 2) / (2 * standard_deviation**2)) for mean in means]
    title = ax.get_title(loc="left").replace("\n", " ").replace("\xa0", " ")
    assert title.startswith("distance = 60 m: near 0.92, middle 0.28, very near 0.06")
    marks = [(*line.get_xdata(), *line.get_ydata()) for line in ax.lines[6:]]
    # 60 m is a point of the universe
    assert marks == [(60.0, pytest.approx(mu, abs=1e-12)) for mu in expected if mu >= 0.005]
    outside = memberships(variable, Figure().subplots(), 250.0)
    assert outside.get_title(loc="left").startswith("distance = 250 m (taken as 200): very far")


SYSTEMS = {
    "two inputs": force_x_system(),
    "three inputs": force_z_system(),
    "one input": one_input_system(),
    "125 rules": autopilot_system(),
    "nine long names": nine_terms_system(),
    "no table": room_system(),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", SYSTEMS)
def test_no_word_of_a_figure_runs_into_another_or_over_the_edge(kind: str) -> None:
    system = SYSTEMS[kind]
    sample = np.array([v.minimum + 0.42 * (v.maximum - v.minimum) for v in system.inputs])
    given = {v.name: float(x) for v, x in zip(system.inputs, sample, strict=True)}
    theme = DARK if kind == "no table" else LIGHT
    figures = dict(system_figures(system, theme=theme))
    figures["marked"] = render.memberships_figure(system, given, theme=theme)
    figures["inference"] = render.inference_figure(infer(system, sample), theme=theme)
    for name, figure in figures.items():
        words = seen_words(figure)
        assert collisions(figure, words) == [], name
        assert min(text.get_size() for text, _ in words) >= 6.5, name


@pytest.mark.slow
@pytest.mark.parametrize("layout", [None, "constrained"])
@pytest.mark.parametrize("kind", ["nine long names", "no table"])
def test_no_word_runs_into_another_on_axes_of_the_usual_size(kind: str, layout: str | None) -> None:
    system = SYSTEMS[kind]
    times, strengths = np.arange(0.0, 30.0, 10.0), np.full((3, len(system.rules)), 0.25)
    values = np.linspace(0.5, 0.0, len(system.rules))
    for draw in (
        lambda ax: memberships(system.inputs[0], ax, system.inputs[0].maximum / 3),
        lambda ax: kind == "no table" or render.rule_matrix(system, ax),
        lambda ax: render.rule_list(system, ax),
        lambda ax: render.rule_bars(system, values, ax),
        lambda ax: render.firing_map(system, times, strengths, ax),
        lambda ax: render.surface_map(system, ax),
        lambda ax: render.output_curve(one_input_system(), ax),
    ):
        figure = Figure(figsize=(6.4, 4.8), layout=layout)
        draw(figure.subplots())
        assert collisions(figure) == []


@pytest.mark.parametrize(
    ("system", "expected"),
    [
        (force_x_system(), {"memberships": 3, "rules": 1, "surface": 2}),
        (force_z_system(), {"memberships": 4, "rules": 3, "surface": 4}),
        (room_system(), {"memberships": 4, "rules": 1, "surface-heat": 2, "surface-vent": 2}),
        (one_input_system(), {"memberships": 2, "rules": 1, "curve": 1}),
    ],
)
def test_figures_of_a_system(system: FuzzySystem, expected: dict[str, int]) -> None:
    figures = dict(system_figures(system))
    assert {name: len(figure.axes) for name, figure in figures.items()} == expected


def test_a_name_with_dollars_stays_a_name() -> None:
    variable = Variable("$a_b$", "$", 0.0, 1.0, (Term("$x^2$", Gaussian(0.0, 1.0)),))
    figure = Figure()
    memberships(variable, figure.subplots(), 0.5)
    assert not any(text.get_parse_math() for text, _ in seen_words(figure))  # type: ignore[attr-defined]


@pytest.mark.parametrize("theme", [LIGHT, DARK])
def test_pictures_leave_the_settings_of_matplotlib_as_they_were(theme: Theme) -> None:
    mpl.get_backend()  # which is chosen when it is asked for
    before = mpl.rcParams.copy()
    system = force_x_system()
    for _, figure in system_figures(system, theme=theme):
        render.encode(figure, "svg")
    render.encode(render.inference_figure(infer(system, np.array([80.0, 0.1])), theme=theme), "png", 50)
    assert mpl.rcParams == before


@pytest.mark.slow
@pytest.mark.parametrize("theme", [LIGHT, DARK])
def test_every_word_can_be_read_on_the_paper_of_a_theme(theme: Theme) -> None:
    system = room_system()
    figures = [figure for _, figure in system_figures(system, theme=theme)]
    figures.append(render.inference_figure(infer(system, np.array([16.0, 3.0])), theme=theme))
    times, strengths = np.arange(3.0), np.full((3, 2), 0.5)
    figures.append(render.firing_figure(system, times, strengths, theme=theme))
    for figure in figures:
        assert figure.get_facecolor() == mpl.colors.to_rgba(theme.paper)
        for text, _ in seen_words(figure):
            is_on_picture = text.get_path_effects() or text.get_bbox_patch() is not None
            if not is_on_picture:
                assert contrast(text.get_color(), theme.paper) >= 4.5, text.get_text()
