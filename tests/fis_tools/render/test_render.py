"""Membership functions and whole figures: what they say, read back, and that words keep apart."""

from dataclasses import replace
from itertools import pairwise
from math import exp
from pathlib import Path
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from fis_tools import render
from fis_tools.engines.inference import infer
from fis_tools.model import FuzzySystem, Gaussian, Term, Variable
from fis_tools.render import memberships, system_figures
from fis_tools.render.inference import conclusion_panel, inference_figure, output_panel, statement_panel
from fis_tools.render.rules import firing_map
from fis_tools.render.surfaces import output_curve
from fis_tools.render.theme import DARK, LIGHT, THEMES, Theme, contrast, readable_on, term_colours
from tests.fis_tools.render import picture_systems
from tests.fis_tools.render.picture_systems import collisions, one_input_system, seen_words
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z, ROOM


def test_membership_functions_are_drawn_named_and_told_apart_without_colour() -> None:
    variable = FORCE_X.inputs[0]
    ax = memberships(variable, Figure().subplots())
    assert [text.get_text() for text in ax.texts] == [term.name for term in variable.terms]
    for line, function in zip(ax.lines, variable.memberships, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), variable.universe)
        np.testing.assert_array_equal(line.get_ydata(), function)
    assert len({line.get_linestyle() + str(line._dash_pattern) for line in ax.lines}) == 5  # type: ignore[attr-defined]
    assert ax.get_xlabel() == "distance (m)"
    assert ax.get_xlim() == (0.0, 200.0)


def test_names_stand_over_their_peaks_and_do_not_run_into_one_another() -> None:
    names = ("rather far to the left", "a little to the left", "just about ahead", "to the right")
    terms = tuple(Term(name, Gaussian(0.1 + 0.1 * index, 0.1)) for index, name in enumerate(names))
    figure = Figure(figsize=(5, 2), layout="constrained")
    ax = memberships(Variable("angle", "rad", 0.0, 1.0, terms), figure.subplots())
    assert collisions(figure) == []
    peaks = [ax.transData.transform((0.1 + 0.1 * index, 1.0)) for index in range(4)]
    for text, (x, y) in zip(ax.texts, peaks, strict=True):
        box = text.get_window_extent()
        assert box.x0 <= x <= box.x1
        assert box.y0 >= y


def test_a_value_is_marked_with_its_memberships_the_greatest_first() -> None:
    variable = FORCE_X.inputs[0]
    ax = memberships(variable, Figure().subplots(), 60.0)
    means, standard_deviation = (0.0, 50.0, 100.0, 150.0, 200.0), 25.0
    expected = [exp(-((60.0 - mean) ** 2) / (2 * standard_deviation**2)) for mean in means]
    assert title(ax).startswith("distance = 60 m: near 0.92, middle 0.28, very near 0.06")
    marks = [(*line.get_xdata(), *line.get_ydata()) for line in ax.lines[6:]]
    # 60 m is a point of the universe
    assert marks == [(60.0, pytest.approx(mu, abs=1e-12)) for mu in expected if mu >= 0.005]
    outside = memberships(variable, Figure().subplots(), 250.0)
    assert outside.get_title(loc="left").startswith("distance = 250 m (taken as 200): very far")


SYSTEMS = {
    "two inputs": FORCE_X,
    "three inputs": FORCE_Z,
    "one input": one_input_system(),
    "125 rules": picture_systems.autopilot_system(),
    "nine long names": picture_systems.nine_terms_system(),
    "no table": ROOM,
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", SYSTEMS)
def test_no_word_of_a_figure_runs_into_another_or_over_the_edge(kind: str) -> None:
    system = SYSTEMS[kind]
    sample = np.array([v.minimum + 0.42 * (v.maximum - v.minimum) for v in system.inputs])
    theme = DARK if kind == "no table" else LIGHT
    figures = dict(system_figures(system, theme=theme))
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
    for draw in (
        lambda ax: memberships(system.inputs[0], ax, system.inputs[0].maximum / 3),
        lambda ax: kind == "no table" or render.rule_matrix(system, ax),
        lambda ax: firing_map(system, times, strengths, ax),
        lambda ax: render.surface_map(system, ax),
        lambda ax: output_curve(one_input_system(), ax),
    ):
        figure = Figure(figsize=(6.4, 4.8), layout=layout)
        draw(figure.subplots())
        assert collisions(figure) == []


@pytest.mark.parametrize(
    ("system", "expected"),
    [
        (FORCE_X, {"memberships": 3, "rules": 1, "surface": 2}),
        (FORCE_Z, {"memberships": 4, "rules": 3, "surface": 4}),
        (ROOM, {"memberships": 4, "surface-heat": 2, "surface-vent": 2}),
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
    for _, figure in system_figures(FORCE_X, theme=theme):
        render.encode(figure, "svg")
    render.encode(render.inference_figure(infer(FORCE_X, np.array([80.0, 0.1])), theme=theme), "png", 50)
    assert mpl.rcParams == before


@pytest.mark.slow
@pytest.mark.parametrize("theme", [LIGHT, DARK])
def test_every_word_can_be_read_on_the_paper_of_a_theme(theme: Theme) -> None:
    figures = [figure for _, figure in system_figures(ROOM, theme=theme)]
    figures.append(render.inference_figure(infer(ROOM, np.array([16.0, 3.0])), theme=theme))
    times, strengths = np.arange(3.0), np.full((3, 2), 0.5)
    figures.append(render.firing_figure(ROOM, times, strengths, theme=theme))
    for figure in figures:
        assert figure.get_facecolor() == mpl.colors.to_rgba(theme.paper)
        for text, _ in seen_words(figure):
            is_on_picture = text.get_path_effects() or text.get_bbox_patch() is not None
            if not is_on_picture:
                assert contrast(text.get_color(), theme.paper) >= 4.5, text.get_text()


def figures() -> dict[str, Figure]:
    drawn = dict(render.system_figures(FORCE_X, theme=render.DARK))
    drawn |= dict(render.surface_figures(FORCE_X, in_space=True))
    drawn["inference"] = render.inference_figure(infer(FORCE_X, np.array([80.0, 0.05])))
    return drawn


@pytest.mark.slow
def test_svg_is_well_formed_holds_its_words_as_text_and_is_identical_twice() -> None:
    words = {
        "memberships": "very near",
        "rules": "towards",
        "surface": "distance (m)",
        "surface-3d": "velocity_body_x (m/s)",
        "inference": "centre of area",
    }
    again = figures()
    for name, figure in figures().items():
        content = render.encode(figure, "svg")
        root = ElementTree.fromstring(content)  # noqa: S314 - our own file
        texts = ["".join(node.itertext()) for node in root.iter("{http://www.w3.org/2000/svg}text")]
        assert any(words[name] in text for text in texts), name
        assert render.encode(again[name], "svg") == content, name
        assert b"<dc:date>" not in content


@pytest.mark.slow
@pytest.mark.parametrize("form", ["png", "pdf"])
def test_pictures_of_pixels_and_pages_are_identical_twice(form: str) -> None:
    figures = [dict(render.rules_figures(FORCE_X))["rules"] for _ in range(2)]
    first, other = (render.encode(figure, form, 60) for figure in figures)
    assert first == other
    assert first.startswith({"png": b"\x89PNG", "pdf": b"%PDF"}[form])
    assert b"matplotlib" not in first.lower()


def test_the_ending_of_a_name_is_the_format(tmp_path: Path) -> None:
    figure, _ = render.one_panel("empty")
    render.save(figure, tmp_path / "a.PNG", 30)
    assert (tmp_path / "a.PNG").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="'docx' is not a picture format; choose one of png, svg, pdf"):
        render.save(figure, tmp_path / "a.docx")


#: Machado, Oliveira and Fernandes 2009, severity 1, for linear red, green and blue: eyes without such cones
EYES = {
    "whole": [1, 0, 0, 0, 1, 0, 0, 0, 1],
    "no red": [0.152286, 1.052583, -0.204868, 0.114503, 0.786281, 0.099216, -0.003882, -0.048116, 1.051998],
    "no green": [0.367322, 0.860646, -0.227968, 0.280085, 0.672501, 0.047413, -0.011820, 0.042940, 0.968881],
    "no blue": [1.255528, -0.076749, -0.178779, -0.078411, 0.930809, 0.147602, 0.004733, 0.691367, 0.303900],
}


def lab(colour: object, eyes: str = "whole") -> np.ndarray:
    """CIE 1976 L*a*b* under D65, as the eyes see it."""
    encoded = np.array(to_rgb(colour))  # type: ignore[arg-type]
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.reshape(EYES[eyes], (3, 3)) @ linear, 0.0, 1.0)
    to_xyz = ((0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505))
    x, y, z = np.array(to_xyz) @ seen / (0.9505, 1.0, 1.089)
    fx, fy, fz = (np.cbrt(v) if v > 0.008856 else 7.787 * v + 16 / 116 for v in (x, y, z))
    return np.array([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)])


@pytest.mark.parametrize("eyes", EYES)
@pytest.mark.parametrize("theme", [LIGHT, DARK])
def test_lines_differ_for_all_eyes(theme: Theme, eyes: str) -> None:
    seen = [lab(colour, eyes) for colour in theme.lines]
    distances = [np.linalg.norm(a - b) for index, a in enumerate(seen) for b in seen[:index]]
    assert min(distances) >= 25


@pytest.mark.parametrize("theme", [LIGHT, DARK])
def test_letters_in_a_themes_colours_can_be_read(theme: Theme) -> None:
    for colour in (*theme.lines, theme.ink, theme.muted):
        assert contrast(colour, theme.paper) >= 4.5
    assert contrast(theme.strong, theme.paper) >= 7


@pytest.mark.parametrize("count", range(2, 10))
def test_terms_become_brighter_in_steps_that_a_grey_print_keeps(count: int) -> None:
    lightness = [lab(tuple(colour))[0] for colour in term_colours(count)]
    assert min(b - a for a, b in pairwise(lightness)) >= 7


def test_words_on_a_terms_colour_can_be_read() -> None:
    for count in range(1, 12):
        for colour in term_colours(count):
            assert contrast(readable_on(colour), colour) >= 4.5


def test_contrast_is_that_of_the_guidelines() -> None:
    assert contrast("white", "black") == pytest.approx(21.0)
    # published examples: the darkest greys that pass AA and fail it on white
    assert contrast("#767676", "white") == pytest.approx(4.54, abs=0.005)
    assert contrast("#777777", "white") == pytest.approx(4.48, abs=0.005)


def test_firing_goes_from_the_paper_to_the_strongest_without_a_turn() -> None:
    for theme in THEMES.values():
        lightness = np.array([lab(theme.strength_map(x))[0] for x in np.linspace(0, 1, 33)])
        assert np.all(np.diff(lightness) * (1 if theme is DARK else -1) > 0)


def title(ax: Axes) -> str:
    return ax.get_title(loc="left").replace("\n", " ").replace("\xa0", " ")


def test_a_statement_shows_how_far_the_input_fulfils_it() -> None:
    step = infer(FORCE_X, np.array([80.0, 0.05]))
    ax = statement_panel(step, FORCE_X.rules[7], FORCE_X.inputs[0], Figure().subplots())
    degree = step.memberships[0][1]
    assert title(ax) == f"near {degree:.2f}"
    marks = [line.get_xydata().tolist() for line in ax.lines if line.get_marker() == "o"]
    assert marks == [[[80.0, degree]]]
    top = max(path.vertices[:, 1].max() for path in ax.collections[0].get_paths())
    assert top == pytest.approx(degree)


def test_a_denied_term_is_drawn_turned_over_and_an_input_not_asked_for_is_empty() -> None:
    step = infer(ROOM, np.array([18.0, 2.0]))
    ax = statement_panel(step, ROOM.rules[0], ROOM.inputs[0], Figure().subplots())
    cold, hot = step.memberships[0]
    assert title(ax) == f"cold {cold:.2f}, not hot {1 - hot:.2f}"
    denied = ax.lines[3].get_ydata()
    assert denied[0] == 1.0
    assert denied[-1] == 0.0
    empty = statement_panel(step, ROOM.rules[1], ROOM.inputs[1], Figure().subplots())
    assert title(empty) == "any"
    assert not empty.lines


def test_a_conclusion_is_cut_at_strength_times_weight() -> None:
    ax = conclusion_panel(ROOM.outputs[1], ROOM.rules[0], 0.8, Figure().subplots())
    assert title(ax) == "open 0.80 × 0.25 = 0.20"
    top = max(path.vertices[:, 1].max() for path in ax.collections[0].get_paths())
    assert top == pytest.approx(0.2)


def test_the_output_is_the_aggregate_with_its_number() -> None:
    output = infer(FORCE_X, np.array([80.0, 0.05])).outputs[0]
    ax = output_panel(output, FORCE_X, Figure().subplots())
    (outline,) = (line for line in ax.lines if len(line.get_xdata()) == len(output.universe))
    np.testing.assert_array_equal(outline.get_ydata(), output.aggregated)
    assert title(ax) == f"force_x = {output.value:.6g} N, centre of area"
    (mark,) = (line for line in ax.lines if line.get_marker() == "^")
    assert mark.get_xdata() == [output.value]


def test_a_figure_shows_the_rules_that_fire_the_strongest_first_and_counts_the_rest() -> None:
    step = infer(FORCE_X, np.array([80.0, 0.05]))
    figure = inference_figure(step, most_rules=3)
    words = [text.get_text().replace("\n", " ") for text, _ in seen_words(figure)]
    order = np.argsort(-step.firing_strengths, kind="stable")
    titles = [word for word in words if word.startswith("rule ")]
    for word, index in zip(titles, order[:3], strict=True):
        assert word.startswith(f"rule {index + 1} fires at {step.firing_strengths[index]:.2f}: If distance")
    firing = int(np.count_nonzero(step.firing_strengths))
    assert f"{firing - 3} more rules fire, at {step.firing_strengths[order[3]]:.2g} or less" in words
    assert any(word.replace("\xa0", " ").startswith("distance = 80 m: ") for word in words)
    assert any(word.startswith("velocity_body_x = 0.05 m/s: ") for word in words)
    # two inputs, three rules of three panels, one output
    assert len(figure.axes) == 2 + 3 * 3 + 1


def test_two_outputs_stand_side_by_side() -> None:
    step = infer(ROOM, np.array([18.0, 2.0]))
    figure = inference_figure(step)
    titles = [title(ax) for ax in figure.axes[-2:]]
    assert titles[0] == f"heat = {step.values[0]:.6g} kW, bisector of the area"
    assert titles[1].startswith(f"vent = {step.values[1]:.6g}, ")
    assert "no other rule fires" in [text.get_text() for text in figure.texts]


def test_where_nothing_fires_the_default_is_told() -> None:
    output = infer(ROOM, np.array([18.0, 16.0])).outputs[0]
    nothing = np.zeros_like(output.aggregated)
    quiet = replace(output, cuts=np.zeros(2), aggregated=nothing, value=0.5, is_default=True)
    ax = output_panel(quiet, ROOM, Figure().subplots())
    assert title(ax) == "heat = 0.5 kW, the default: no rule fires"
