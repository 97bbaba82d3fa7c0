"""Outputs by Takagi and Sugeno and by Tsukamoto: twins, closed forms, pyfuzzylite."""

import numpy as np
import pytest

from fis_tools.analysis.shapley import shares
from fis_tools.engines import interval
from fis_tools.engines.compiler import compile
from fis_tools.engines.defuzzifier import invert
from fis_tools.engines.program import INVERTED
from fis_tools.model.variables import shape_values
from tests.fis_tools import step_by_step
from tests.fis_tools.engines.weighed_systems import ENDLESS, MONOTONE, SYSTEMS, samples


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_compiled_form_is_the_readable_one(name: str) -> None:
    system = SYSTEMS[name]
    rows = samples(system)
    np.testing.assert_allclose(compile(system)(rows), step_by_step.evaluate(system, rows), rtol=0, atol=1e-13)


def test_an_average_is_the_mean_of_numbers_by_strength() -> None:
    """The formula of Takagi and Sugeno, written out over the table of rules."""
    system = SYSTEMS["linear"]
    rows = np.clip(samples(system), 0.0, 10.0)
    degrees = np.exp(-((rows[:, :, None] - [0.0, 5.0, 10.0]) ** 2) / (2 * 1.5**2))
    strengths = (degrees[:, 0, :, None] * degrees[:, 1, None, :]).reshape(-1, 9)
    factors = np.array([[0.1, -0.15, 0.5], [0.0, 0.0, -1.0], [-0.05, 0.2, 0.0]] * 3)
    numbers = rows @ factors[:, :2].T + factors[:, 2]
    expected = (strengths * numbers).sum(axis=1) / strengths.sum(axis=1)
    np.testing.assert_allclose(compile(system)(rows)[:, 0], expected, atol=2e-4)  # linear between 501 points


@pytest.mark.parametrize("shape", [*MONOTONE, *ENDLESS])
def test_a_shape_has_the_degree_where_its_inverse_says(shape: object) -> None:
    degrees = np.linspace(0.01, 0.99, 50)
    np.testing.assert_allclose(shape_values(shape.inverse(degrees), shape), degrees, atol=1e-12)  # type: ignore[attr-defined, arg-type]
    kind = INVERTED.index(type(shape))  # type: ignore[arg-type]
    numbers = [getattr(shape, name) for name in shape.entry.kinds]  # type: ignore[attr-defined]
    compiled = [invert(kind, *numbers, degree) for degree in degrees]
    np.testing.assert_allclose(compiled, shape.inverse(degrees), atol=1e-13)  # type: ignore[attr-defined]


def test_a_sigmoid_at_full_strength_leads_to_the_end_of_the_range() -> None:
    system = SYSTEMS["tsukamoto_endless"]
    assert np.isfinite(compile(system)(np.array([[0.0, 0.0]]))).all()


@pytest.mark.parametrize("name", [name for name in SYSTEMS if name != "tsukamoto_endless"])
def test_no_output_leaves_its_bounds(name: str) -> None:
    system = SYSTEMS[name]
    compiled = compile(system)
    program = interval.pack(system)
    low = np.clip(samples(system, 60), 0.0, 10.0)
    high = np.minimum(low + np.random.default_rng(1).uniform(0.0, 2.0, low.shape), 10.0)
    least, greatest, _ = interval.bound(program, low, high)
    for share in np.random.default_rng(2).uniform(size=(40, low.shape[1])):
        outputs = compiled(low + share * (high - low))
        assert (outputs >= least).all()
        assert (outputs <= greatest).all()
    assert np.median(greatest - least) < 2.0  # of 4, the range: the bounds say something


def test_endless_terms_have_no_bounds() -> None:
    with pytest.raises(interval.NotBounded, match="has no limit"):
        interval.pack(SYSTEMS["tsukamoto_endless"])


@pytest.mark.parametrize("name", [name for name in SYSTEMS if name != "mixed"])
def test_shares_of_rules_add_up_to_the_output(name: str) -> None:
    system = SYSTEMS[name]
    rows, compiled = samples(system), compile(system)
    found = shares(compiled, rows)
    assert not found.error.any()
    np.testing.assert_allclose(found.values.sum(axis=1) + 0.25, compiled(rows), atol=1e-12)


@pytest.mark.parametrize("name", ["constant", "linear", "mixed"])
def test_a_prepared_function_gives_what_arrays_give(name: str) -> None:
    compiled = compile(SYSTEMS[name])
    rows, infer = samples(compiled.system, 30), compiled.prepare()
    np.testing.assert_allclose([infer(*row) for row in rows.tolist()], compiled(rows), atol=1e-14)
    assert infer(*[np.inf] * rows.shape[1]) == infer(*[10.0] * rows.shape[1])
    with pytest.raises(ValueError, match="is NaN"):
        infer(*[np.nan] * rows.shape[1])
    with pytest.raises(ValueError, match="0 inputs are given; pass"):
        infer()
