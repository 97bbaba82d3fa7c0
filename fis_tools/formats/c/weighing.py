"""The parts of the C that weigh the numbers that rules conclude, by Takagi and Sugeno or Tsukamoto."""

from collections.abc import Sequence

from fis_tools.model import (
    Arc,
    Concave,
    Formula,
    Linear,
    MembershipFunction,
    MonotoneFunction,
    Number,
    Ramp,
    Sigmoid,
    SShape,
    Variable,
    ZShape,
)

WEIGH = """\
/* Adds a number that a rule concludes, by the strength of the rule. */
static void weigh(double strength, double number, double *total, double *moment)
{
    if (strength > 0.0) {
        *total += strength;
        *moment += strength * number;
    }
}
"""

INSIDE = """\
/* The input inside of its universe. */
static double inside(double x, double low, double high)
{
    return x < low ? low : (x > high ? high : x);
}
"""

_INVERSE = """\
/* Where {name} from {first} and {second} has a degree above zero. */
static double where_{name}(double degree, double {first}, double {second})
{{
    return {formula};
}}
"""
_PARABOLAS = (
    "degree <= 0.5 ? foot + (top - foot) * sqrt(degree / 2.0)\n"
    "                         : top - (top - foot) * sqrt((1.0 - degree) / 2.0)"
)
_FORMULAS: dict[type[MembershipFunction], tuple[str, str, str, str]] = {
    Ramp: ("ramp", "start", "end", "start + (end - start) * degree"),
    Sigmoid: ("sigmoid", "inflection", "slope", "inflection - log(1.0 / degree - 1.0) / slope"),
    SShape: ("s_shape", "foot", "top", _PARABOLAS),
    ZShape: ("z_shape", "top", "foot", _PARABOLAS),
    Concave: ("concave", "inflection", "end", "2.0 * end - inflection + (inflection - end) / degree"),
    Arc: ("arc", "start", "end", "end + (start - end) * sqrt(1.0 - degree * degree)"),
}


def functions(shapes: Sequence[MembershipFunction]) -> list[str]:
    """Write the functions that concluding these terms needs, each once."""
    found = [WEIGH] if shapes else []
    if any(isinstance(shape, Linear) and any(shape.coefficients) for shape in shapes):
        found.append(INSIDE)
    for kind, (name, first, second, formula) in _FORMULAS.items():
        if any(type(shape) is kind for shape in shapes):
            found.append(_INVERSE.format(name=name, first=first, second=second, formula=formula))
    return found


def concluded(shape: MembershipFunction, strength: str, inputs: Sequence[Variable], output: Variable) -> str:
    """Write the number that a rule of some strength concludes, an expression of doubles."""
    if isinstance(shape, Formula):
        raise ValueError(
            f"output {output.name!r} concludes the formula {shape.text[:40]!r}, and C is written for numbers "
            "linear in the inputs; export as fll or json"
        )
    if isinstance(shape, Number):
        *coefficients, constant = shape.row(len(inputs))
        terms = [repr(float(constant))]
        terms += [
            f"{float(coefficient)!r} * inside(inputs[{place}], {float(v.minimum)!r}, {float(v.maximum)!r})"
            for place, (coefficient, v) in enumerate(zip(coefficients, inputs, strict=True))
            if coefficient
        ]
        return " + ".join(terms)
    assert isinstance(shape, MonotoneFunction)  # noqa: S101 - any other has been refused by validation
    first, second = (repr(float(getattr(shape, name))) for name in shape.entry.kinds)
    place = f"where_{shape.entry.name}({strength} < 1.0 ? {strength} : 1.0, {first}, {second})"
    if isinstance(shape, Sigmoid):  # reaches one nowhere
        end = output.maximum if shape.slope > 0.0 else output.minimum
        return f"{strength} < 1.0 ? {place} : {float(end)!r}"
    return place
