"""Controllers to test with: one like the paper's, and one with everything a fuzzy system can have."""

from fis_tools.model import (
    And,
    Consequent,
    FuzzyController,
    FuzzySystem,
    Gaussian,
    Is,
    Not,
    Or,
    Rule,
    Sampled,
    Term,
    Trapezoidal,
    Triangular,
    Variable,
    table_rules,
)

FORCE_TERMS = ("NL", "NS", "ZE", "PS", "PL")


def gaussian_terms(names: tuple[str, ...], low: float, high: float, overlap: float = 0.5) -> tuple[Term, ...]:
    """Evenly spaced Gaussian terms; `overlap` is the standard deviation in units of the spacing."""
    spacing = (high - low) / (len(names) - 1)
    return tuple(
        Term(name, Gaussian(low + index * spacing, overlap * spacing)) for index, name in enumerate(names)
    )


def distance() -> Variable:
    names = ("very near", "near", "middle", "far", "very far")
    return Variable(
        "distance", "m", 0.0, 200.0, gaussian_terms(names, 0.0, 200.0), description="From the chief."
    )


def velocity() -> Variable:
    names = ("away fast", "away", "still", "towards", "towards fast")
    return Variable("velocity_body_x", "m/s", -0.3, 0.3, gaussian_terms(names, -0.3, 0.3, 0.45))


def force(name: str = "force_x") -> Variable:
    return Variable(name, "N", -0.1, 0.1, gaussian_terms(FORCE_TERMS, -0.1, 0.1, 0.4), default=0.0)


def force_x_system() -> FuzzySystem:
    """25 rules: brake when moving fast, come nearer when far, keep off when near."""
    inputs = (distance(), velocity())
    rows = (
        ("PL", "PS", "NS", "NL", "NL"),  # very near
        ("PL", "PS", "NS", "NS", "NL"),
        ("PL", "PS", "ZE", "NS", "NL"),
        ("PL", "PS", "PS", "ZE", "NS"),
        ("PL", "PL", "PL", "PS", "ZE"),
    )
    table = [term for row in rows for term in row]
    output = force()
    return FuzzySystem("force_x", inputs, (output,), table_rules(inputs, output, table))


def force_z_system() -> FuzzySystem:
    """45 rules over three inputs."""
    angle_terms = gaussian_terms(("left", "ahead", "right"), -3.14, 3.14)
    inputs = (
        Variable("eta_u", "rad", -3.14, 3.14, angle_terms),
        Variable("velocity_body_z", "m/s", -0.3, 0.3, gaussian_terms(FORCE_TERMS, -0.3, 0.3)),
        Variable("distance", "m", 0.0, 200.0, gaussian_terms(("near", "middle", "far"), 0.0, 200.0)),
    )
    output = force("force_z")
    table = [
        FORCE_TERMS[min(4, max(0, 4 - speed + (angle - 1) + (reach - 1) * (angle - 1)))]
        for angle in range(3)
        for speed in range(5)
        for reach in range(3)
    ]
    return FuzzySystem("force_z", inputs, (output,), table_rules(inputs, output, table))


def paper_like_controller() -> FuzzyController:
    return FuzzyController(
        "paper-like",
        (force_x_system(), force_z_system()),
        attributes=(("force_axes", "body"),),
        provenance=(("made_by", "hand"), ("paper", "AAS 25-727")),
    )


def general_controller() -> FuzzyController:
    """Rule trees, weights, labels, two outputs, every shape, an uneven universe."""
    temperature = Variable(
        "temperature",
        "degC",
        0.0,
        40.0,
        (Term("cold", Trapezoidal(0.0, 0.0, 10.0, 20.0)), Term("hot", Triangular(15.0, 40.0, 40.0))),
        num_points=41,
    )
    points = (0.0, 1.0, 4.0, 9.0, 16.0)
    wind = Variable(
        "wind", "m/s", 0.0, 16.0, (Term("calm", Sampled((1.0, 0.8, 0.3, 0.1, 0.0))),), 5, points=points
    )
    heat = Variable(
        "heat",
        "kW",
        0.0,
        2.0,
        (Term("low", Gaussian(0.0, 0.4)), Term("high", Gaussian(2.0, 0.4))),
        default=0.5,
    )
    vent = Variable("vent", "", 0.0, 1.0, (Term("open", Triangular(0.0, 1.0, 1.0)),), 11, default=0.0)
    rules = (
        Rule(
            And((Is("temperature", "cold"), Or((Is("wind", "calm"), Not(Is("temperature", "hot")))))),
            (Consequent("heat", "high"), Consequent("vent", "open", 0.25)),
            label="warm up",
        ),
        Rule(Is("temperature", "hot"), (Consequent("heat", "low", 0.75), Consequent("vent", "open"))),
    )
    system = FuzzySystem(
        "room", (temperature, wind), (heat, vent), rules, "product", "probabilistic_sum", "bisector"
    )
    return FuzzyController("general", (system,))
