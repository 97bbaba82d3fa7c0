"""A shape that is not shipped, and all that its one entry in the registry brings about; run as a program."""

from dataclasses import dataclass, replace

import numpy as np

from fis_tools.model.shape import Floats, MembershipFunction, Place, Width, shape


@shape("cosine_bump", "cosine bump, centre {centre}, half width {width}", fll=("Bump", "width", "centre"))
@dataclass(frozen=True, slots=True)
class CosineBump(MembershipFunction):
    """``(1 + cos(pi (x - centre) / width)) / 2`` within `width` of the `centre`, zero beyond."""

    centre: Place
    width: Width

    def at(self, x: Floats) -> Floats:
        away = np.minimum(np.abs(x - self.centre) / self.width, 1.0)
        return 0.5 * (1.0 + np.cos(np.pi * away))


import fis_tools
from fis_tools.findings.simplification.rounding import rounded
from fis_tools.formats import serialize
from fis_tools.formats.c import source
from fis_tools.formats.exchange import fcl, fis, fll, fml
from fis_tools.formats.printed import html, latex, markdown
from fis_tools.model import (
    Consequent,
    FuzzyController,
    FuzzySystem,
    Gaussian,
    Is,
    Rule,
    Sampled,
    Term,
    Variable,
)
from fis_tools.model.validate import problems
from fis_tools.words.text import shape_words

bump = Term("bump", CosineBump(4.04, 3.0))
x = Variable("x", "m", 0.0, 10.0, (bump, Term("hill", Gaussian(8.0, 1.0))), 21)
y = Variable(
    "y", "n", -1.0, 1.0, (Term("low", CosineBump(-1.0, 1.0)), Term("high", CosineBump(1.0, 1.0))), default=0.0
)
rules = tuple(Rule(Is("x", a), (Consequent("y", b),)) for a, b in (("bump", "low"), ("hill", "high")))
system = FuzzySystem("s", (x,), (y,), rules)
controller = FuzzyController("s", (system,))

assert problems(system) == []
narrow = replace(x, terms=(Term("bump", CosineBump(4.0, -3.0)), x.terms[1]))
(told,) = problems(replace(system, inputs=(narrow,)))
assert told.endswith("width -3.0 is not positive; give a number above 0"), told
assert shape_words(bump) == "cosine bump, centre 4.04, half width 3"
for printed in (html, latex, markdown):
    assert "cosine bump, centre 4.04" in printed.write(controller)

# Outputs of low and high mirror one another, so that equal strengths give zero: where bump and hill cross.
at = np.array([4.04, 8.0])
assert np.allclose(fis_tools.compile(system)({"x": at})["y"], [-1.0, 1.0], atol=0.4)
grid = np.linspace(0.0, 10.0, 201)
outputs = fis_tools.compile(system)({"x": grid})["y"]

for kind, dump in (("json", serialize.dump_json), ("yaml", serialize.dump_yaml)):
    assert serialize.loads(dump(controller), kind) == controller
for kind, form in (("fis", fis), ("fll", fll), ("fml", fml)):
    written = form.write(controller).text
    assert serialize.loads(written, kind) == controller
    seen = serialize.loads(
        "\n".join(line for line in written.splitlines() if "fis_tools carries" not in line), kind
    )
    (shown,) = seen.systems
    # fll and fml have a word for it; a .fis file shows it as a table of the same points.
    assert (type(shown.inputs[0].terms[0].membership) is Sampled) == (kind == "fis")
    inferred = fis_tools.compile(shown)({shown.inputs[0].name: grid})[shown.outputs[0].name]
    assert np.abs(inferred - outputs).max() < (1e-12 if kind == "fis" else 0.02), kind
assert "TERM bump := (0.0, 0.0)" in fcl.write(controller).text
assert "double" in source.write(controller)
(simple,) = rounded(system, {("x", "bump"): 1}).inputs
assert simple.terms[0].membership == CosineBump(4.0, 3.0)
print("all of it")
