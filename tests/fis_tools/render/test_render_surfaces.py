"""Outputs over one and two inputs: what is drawn is what the system gives."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from fis_tools.analysis.arrays import surface
from fis_tools.engines.inference import infer
from fis_tools.model import table_rules
from fis_tools.render import DARK, draw_surface, surface_map, surface_space
from fis_tools.render.figures import surface_figure
from fis_tools.render.surfaces import output_curve
from tests.fis_tools.render.picture_systems import autopilot_system, one_input_system
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z


def flat() -> Any:
    return Figure().subplots()


def in_space() -> Any:
    return Figure().subplots(subplot_kw={"projection": "3d"})


@pytest.mark.slow
def test_the_surface_map_lies_as_the_rule_matrix_does():
    ax = surface_map(FORCE_X, flat())
    values = np.asarray(ax.images[0].get_array())
    # up the y axis the distance grows, along x the velocity
    assert ax.get_ylabel() == "distance (m)"
    assert values[-1, 0] == pytest.approx(infer(FORCE_X, np.array([200.0, -0.3])).values[0], abs=1e-13)
    assert values[0, -1] == pytest.approx(infer(FORCE_X, np.array([0.0, 0.3])).values[0], abs=1e-13)
    assert ax.images[0].get_clim() == (values.min(), values.max())
    assert ax.images[0].origin == "lower"


def test_a_pixel_lies_where_its_value_belongs():
    ax = draw_surface(surface(FORCE_X, "velocity_body_x", "distance", num_points=5), flat())
    left, right, bottom, top = ax.images[0].get_extent()
    # the middle of the first pixel of five is the least velocity, that of the last the greatest
    assert left + (right - left) / 10 == pytest.approx(-0.3)
    assert top - (top - bottom) / 10 == pytest.approx(200.0)
    assert ax.get_xlim() == pytest.approx((-0.3, 0.3))


def thick_lines(ax: object) -> list[np.ndarray]:
    """Return the vertices of the contour that is thicker than the others."""
    contours = [c for c in ax.collections if max(c.get_linewidths(), default=0) > 2]  # type: ignore[attr-defined]
    return [path.vertices for contour in contours for path in contour.get_paths() if len(path.vertices)]


def test_a_thick_contour_is_where_the_output_changes_sign():
    ax = surface_map(FORCE_X, flat())
    (vertices,) = thick_lines(ax)
    outputs = [infer(FORCE_X, np.array([distance, speed])).values[0] for speed, distance in vertices[::9]]
    assert np.max(np.abs(outputs)) < 0.02 * 0.2
    assert "0" in [text.get_text() for text in ax.texts]


def test_where_rules_cancel_the_contour_of_zero_does_not_follow_the_last_digits():
    result = surface(FORCE_X, num_points=31)
    noise = np.random.default_rng(0).choice([-1e-17, 1e-17], (31, 31))
    values = np.where(np.abs(result.x) <= 100, noise, np.sign(result.x - 100) * 0.05)
    values[:, :5] = -0.05
    ax = draw_surface(replace(result, values=values), flat())
    for vertices in thick_lines(ax):
        assert np.ptp(vertices[:, 0]) < 2 * 200 / 30


def test_without_a_change_of_sign_no_contour_is_thick():
    table = ["PS", "PL"] * 12 + ["PL"]
    pushing = replace(FORCE_X, rules=table_rules(FORCE_X.inputs, FORCE_X.outputs[0], table))
    assert surface(pushing).values.min() > 0
    assert not thick_lines(surface_map(pushing, flat()))
    assert not thick_lines(surface_space(surface(pushing), in_space()))


def test_a_flat_surface_is_drawn_without_contours():
    output = FORCE_X.outputs[0]
    still = replace(FORCE_X, rules=table_rules(FORCE_X.inputs, output, ["ZE"] * 25))
    ax = surface_map(still, flat())
    assert not ax.texts
    assert ax.images[0].get_clim() == (output.minimum, output.maximum)
    assert len(surface_space(surface(still, num_points=5), in_space()).collections) == 1


def test_what_is_held_is_in_the_title():
    ax = surface_map(FORCE_Z, flat())
    assert ax.get_title() == "eta_u = 0 rad"
    value = infer(FORCE_Z, np.array([0.0, 0.3, 0.0])).values[0]
    assert np.asarray(ax.images[0].get_array())[-1, 0] == pytest.approx(value, abs=1e-13)


def test_samples_lie_over_the_map_inside_the_universes():
    samples = np.array([[80.0, 0.1], [250.0, -0.5]])
    ax = surface_map(FORCE_X, flat(), samples=samples)
    (marks,) = ax.lines
    np.testing.assert_array_equal(marks.get_xydata(), [[0.1, 80.0], [-0.3, 200.0]])
    with pytest.raises(ValueError, match="2 inputs, pass a row a sample"):
        surface_map(FORCE_X, flat(), samples=samples[:, :1])


def test_samples_are_marked_in_the_slice_to_whose_term_they_belong():
    samples = np.array([[-3.0, 0.1, 50.0], [3.0, 0.2, 60.0], [2.9, -0.2, 70.0]])
    figure = surface_figure(FORCE_Z, samples=samples)
    marks = [ax.lines[0].get_xydata().tolist() for ax in figure.axes[:3]]
    assert marks == [[[50.0, 0.1]], [], [[60.0, 0.2], [70.0, -0.2]]]


def test_slices_share_their_colours_and_tell_what_is_held():
    figure = surface_figure(autopilot_system())
    panels = [ax for ax in figure.axes if ax.images]
    assert [ax.get_title() for ax in panels] == [f"pitch = {value} deg" for value in (-30, -15, 0, 15, 30)]
    assert len({ax.images[0].get_clim() for ax in panels}) == 1


def test_in_space_the_surface_is_that_of_the_system_over_a_floor_with_contours(monkeypatch):
    result = surface(FORCE_X, num_points=21)
    ax, nets = in_space(), []
    draw = ax.plot_surface
    monkeypatch.setattr(ax, "plot_surface", lambda *net, **how: nets.append(net) or draw(*net, **how))
    surface_space(result, ax, points=np.array([[100.0, 0.1]]), theme=DARK)
    ((x, y, values),) = nets
    assert values[3, 7] == pytest.approx(infer(FORCE_X, np.array([x[3, 7], y[3, 7]])).values[0], abs=1e-13)
    np.testing.assert_array_equal(values, result.values)
    floor = ax.get_zlim()[0]
    assert floor < result.values.min()
    assert np.all(ax.lines[0].get_data_3d()[2] == floor)
    assert thick_lines(ax)
    labels = ["distance (m)", "velocity_body_x (m/s)", "force_x (N)"]
    assert [ax.get_xlabel(), ax.get_ylabel(), ax.get_zlabel()] == labels


def test_a_curve_over_one_input():
    system = one_input_system()
    ax = output_curve(system, flat(), samples=np.array([[0.1]]))
    x, y = (values[::67] for values in ax.lines[1].get_data())
    assert y == pytest.approx([infer(system, np.array([value])).values[0] for value in x], abs=1e-13)
    assert ax.lines[2].get_xdata() == [0.1]
    assert ax.get_ylabel() == "force_x (N)"
