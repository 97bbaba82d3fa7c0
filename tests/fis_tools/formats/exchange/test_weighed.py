"""Outputs that are weighed, in the files of other programs and through the programs themselves."""

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from fis_tools.engines.compiler import compile
from fis_tools.errors import ControllerFileError
from fis_tools.formats.exchange import fis, fll
from fis_tools.formats.exchange.antecedents import NotExpressible
from fis_tools.formats.exchange.dialect import express
from fis_tools.model import FuzzySystem, Ramp
from tests.fis_tools.engines.weighed_systems import MONOTONE, RAMPS, SIGMOIDS, SYSTEMS, samples
from tests.fis_tools.engines.weighed_systems import system as weighed
from tests.fis_tools.formats.exchange.outside import fuzzylite_outputs
from tests.fis_tools.formats.exchange.systems import alone, without_comment, written

LIKE_FUZZYLITE_6 = weighed("weighted_average", *RAMPS, *SIGMOIDS, Ramp(-2.0, 0.0))


def read_back(system: FuzzySystem, form: ModuleType) -> FuzzySystem:
    """Write a system, take away what the comment carries, and read what others see."""
    return form.read(without_comment(form.write(alone(system)).text)).controller.systems[0]


@pytest.mark.parametrize("form", [fis, fll])
@pytest.mark.parametrize("name", [name for name in SYSTEMS if name != "mixed"])
def test_what_is_written_is_read(name: str, form: ModuleType) -> None:
    system = SYSTEMS[name]
    if (form, name) == (fis, "tsukamoto"):
        with pytest.raises(ValueError, match="has no word"):  # an arc, a sigmoid
            form.write(alone(system))
        return
    assert fll.read(fll.write(alone(system)).text).controller.systems[0] == system
    visible = read_back(system, form)
    expressed = express(system, form.DIALECT).system
    assert visible.outputs[0].terms == expressed.outputs[0].terms
    assert visible.rules == expressed.rules
    rows = samples(system)
    np.testing.assert_allclose(compile(visible)(rows), compile(expressed)(rows), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "form"),
    [("constant", fis), *((name, fll) for name in ("linear", "linear_sum", "tsukamoto", "mixed"))],
)
def test_fuzzylite_weighs_as_we_do(name: str, form: ModuleType, tmp_path: Path) -> None:
    # of fuzzylite 6, pyfuzzylite corrects the inverses of S and Z shapes and of Concave, and adds Arc
    system = LIKE_FUZZYLITE_6 if name == "tsukamoto" else SYSTEMS[name]
    rows = np.clip(samples(system, 60), 0.05, 9.95)
    theirs = fuzzylite_outputs(written(tmp_path, system, form), rows, tmp_path)
    fine = read_back(system, form)  # the system as others see it
    ours = compile(fine)(rows)
    if name == "mixed":  # the other output is defuzzified, by sampling
        theirs, ours = theirs[:, :1], ours[:, :1]
    fires = ~np.isnan(theirs)
    # straight lines between 10,001 points of an input stand for its Gaussians
    np.testing.assert_allclose(ours[fires], theirs[fires], atol=4e-5)


_FLL = """Engine: one
InputVariable: a
  range: 0 1
OutputVariable: y
  range: {range}
  aggregation: {aggregation}
  defuzzifier: {defuzzifier}
  default: nan
  term: up {term}
RuleBlock:
  conjunction: Minimum
  implication: {implication}
  rule: if a is any then y is up
  rule: if a is very any then y is up
"""
_USUAL = {"range": "0 1", "aggregation": "none", "defuzzifier": "WeightedAverage TakagiSugeno"}
_USUAL |= {"term": "Linear 2 0.5", "implication": "none"}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"term": "Function 2*"}, r"the formula '2\*' has 'its end' where '\(' must be; it may have"),
        ({"term": "Triangle 0 1 2"}, "its term is a 'Triangle', which cannot be weighed"),
        ({"term": "Linear 2 0.5 1 7"}, "Linear has the numbers 2, 0.5, 1, 7; expected 2 finite ones"),
        ({"term": "Ramp 0 1"}, "weighted as 'TakagiSugeno', but its term 'up' is Ramp; write Tsukamoto"),
        ({"aggregation": "Maximum"}, "joins the rules that conclude 'up', but each counts by itself"),
        ({"defuzzifier": "Centroid 100", "aggregation": "Maximum"}, "only outputs by Weigh"),
    ],
)
def test_what_cannot_be_weighed_is_refused(change: dict[str, str], sentence: str) -> None:
    with pytest.raises(ControllerFileError, match=sentence):
        fll.read(_FLL.format(**_USUAL | change))


def test_rules_of_one_tsukamoto_term_are_not_left_to_fuzzylite() -> None:
    """It adds their strengths up before it looks where the term has them."""
    system = weighed("weighted_average", *MONOTONE[:8])
    with pytest.raises(NotExpressible, match="rules 1 and 9 conclude 'y_0'"):
        fll.write(alone(system))
    text = _FLL.format(**_USUAL | {"term": "Ramp 0 1", "defuzzifier": "WeightedAverage"})
    with pytest.raises(ControllerFileError, match="rules 1 and 2 conclude 'up'"):
        fll.read(text)


def test_inputs_without_terms_and_outputs_without_a_range_are_completed_and_told() -> None:
    reading = fll.read(_FLL.format(**_USUAL | {"range": "0 0"}))
    (system,) = reading.controller.systems
    assert (system.outputs[0].minimum, system.outputs[0].maximum) == (0.5, 2.5)
    assert any("the range of y is empty" in sentence for sentence in reading.assumptions)
    np.testing.assert_allclose(compile(system)(np.array([[0.25]])), [[1.0]])


def test_the_kind_of_a_fis_file_and_its_defuzzifier_must_agree() -> None:
    text = fis.write(alone(SYSTEMS["constant"])).text
    for kind in ("'mamdani'", "'hybrid'"):
        with pytest.raises(ControllerFileError, match="outputs of mamdani are defuzzified"):
            fis.read(text.replace("'sugeno'", kind))
