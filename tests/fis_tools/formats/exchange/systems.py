"""Systems to exchange: what the formats can say, everything of it."""

from collections.abc import Sequence
from dataclasses import replace

from fis_tools.model import (
    And,
    Consequent,
    FuzzyController,
    FuzzySystem,
    Gaussian,
    GeneralizedBell,
    Is,
    Not,
    Or,
    PiShape,
    Rule,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    SShape,
    Term,
    Trapezoidal,
    Triangular,
    TwoSidedGaussian,
    Variable,
    ZShape,
)


def flat_system(and_operator: str = "min", or_operator: str = "max") -> FuzzySystem:
    """Every shape; weights, not, or, partial antecedents, two outputs; nothing nested."""
    temperature = Variable(
        "temperature",
        "degC",
        -10.0,
        40.0,
        (
            Term("freezing", ZShape(-5.0, 8.0)),
            Term("cold", TwoSidedGaussian(4.0, 3.0, 9.0, 5.0)),
            Term("mild", GeneralizedBell(6.0, 3.0, 18.0)),
            Term("warm", PiShape(16.0, 22.0, 26.0, 33.0)),
            Term("hot", Sigmoid(30.0, 0.7)),
        ),
    )
    wind = Variable(
        "wind",
        "m/s",
        0.0,
        25.0,
        (
            Term("calm", Trapezoidal(0.0, 0.0, 2.0, 6.0)),
            Term("breeze", SigmoidDifference(4.0, 1.5, 12.0, 1.1)),
            Term("strong", SigmoidProduct(10.0, 1.2, 19.0, -0.9)),
            Term("storm", SShape(15.0, 22.0)),
        ),
    )
    heat = Variable(
        "heat",
        "kW",
        0.0,
        12.0,
        (
            Term("none", Triangular(0.0, 0.0, 3.0)),
            Term("some", Gaussian(5.0, 1.4)),
            Term("much", Triangular(7.0, 12.0, 12.0)),
        ),
        default=1.5,
    )
    flap = Variable(
        "flap",
        "",
        -1.0,
        1.0,
        (Term("shut", Trapezoidal(-1.0, -1.0, -0.6, 0.1)), Term("open", SShape(-0.2, 0.8))),
        default=-1.0,
    )
    rules = (
        Rule(
            And((Is("temperature", "freezing"), Not(Is("wind", "calm")))),
            (Consequent("heat", "much"), Consequent("flap", "shut")),
        ),
        Rule(Or((Is("temperature", "cold"), Is("wind", "storm"))), (Consequent("heat", "much", 0.7),)),
        Rule(Is("temperature", "mild"), (Consequent("heat", "some", 0.9), Consequent("flap", "open", 0.9))),
        Rule(
            And((Is("temperature", "warm"), Is("wind", "breeze"))),
            (Consequent("heat", "none"), Consequent("flap", "open")),
        ),
        Rule(Not(Is("temperature", "hot")), (Consequent("heat", "some", 0.2),)),
        Rule(Is("temperature", "hot"), (Consequent("heat", "none"),)),
        Rule(Or((Not(Is("temperature", "mild")), Is("wind", "strong"))), (Consequent("flap", "shut", 0.4),)),
    )
    return FuzzySystem(
        "climate",
        (temperature, wind),
        (heat, flap),
        rules,
        and_operator,  # type: ignore[arg-type]
        or_operator,  # type: ignore[arg-type]
    )


def denied_system() -> FuzzySystem:
    """The same with a conjunction denied, weights that differ, labels, two conclusions on one output."""
    system = flat_system()
    more = (
        Rule(
            And((Is("temperature", "cold"), Not(Is("wind", "calm")))),
            (Consequent("heat", "much", 0.8), Consequent("flap", "shut")),
            label="keep warm",
        ),
        Rule(
            Not(And((Is("temperature", "freezing"), Is("wind", "storm")))),
            (Consequent("heat", "some", 0.3), Consequent("heat", "none", 0.3)),
            label="everyday",
        ),
    )
    return replace(system, rules=(*more, *system.rules))


def nested_system() -> FuzzySystem:
    """The same with a rule that nests."""
    system = denied_system()
    asked = And((Is("temperature", "cold"), Or((Is("wind", "strong"), Not(Is("wind", "calm"))))))
    return replace(system, rules=(replace(system.rules[0], antecedent=asked), *system.rules[1:]))


def fine(system: FuzzySystem, num_points: int) -> FuzzySystem:
    """The same system on universes of so many points."""

    def refined(variables: Sequence[Variable]) -> tuple[Variable, ...]:
        return tuple(replace(variable, num_points=num_points) for variable in variables)

    return replace(system, inputs=refined(system.inputs), outputs=refined(system.outputs))


def alone(system: FuzzySystem) -> FuzzyController:
    """A controller with one system and facts of its own."""
    return FuzzyController(
        "exchanged", (system,), (("axis", "x"), ("note", "a -- b */ <c> & 'd' # e")), (("made_by", "hand"),)
    )
