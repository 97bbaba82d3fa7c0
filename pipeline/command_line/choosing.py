"""Which champion to take, by world and Sun: results that stand, with their commands, on other pages."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class Choice:
    """A recommended controller, the world and Sun it is for, and the results measured there."""

    controller: str
    rules: int
    world: str
    sun: str
    delta_v: str  # mean, m/s; as what follows, empty if not measured
    success: str
    outside: str  # of the limits
    layer: str  # the same with the safety layer
    purpose: str
    source: str = "reference/results.md"  # the page under docs that has the figures, and their intervals


HEADINGS: Final = (
    *("controller", "rules", "world", "Sun", "delta-v (m/s)", "success", "outside", "with the safety layer"),
    "for",
)

# fmt: off
CHOICES: Final = (
    Choice("champion_27", 27, "paper", "any", "0.435", "99.1 %", "0.2 %", "0.428 m/s, 0.0 % outside",
           "rules alone, on one page"),
    Choice("champion_81", 81, "paper", "any", "0.423", "99.8 %", "0.0 %", "0.419 m/s, 0.0 % outside",
           "rules alone, fewer failures"),
    Choice("champion_27_one_push", 27, "paper", "any", "0.348", "100.0 %", "0.0 %",
           "0.347 m/s, 0.0 % outside", "rules after a first push that flights ahead choose"),
    Choice("champion_27_rehearsed", 27, "paper", "any", "0.198", "100.0 %", "0.0 %", "",
           "least fuel: plans decide, rules fire 0.8 % of it"),
    Choice("paper_champion", 75, "paper", "any", "1.231", "87.3 %", "0.0 %", "",
           "comparison with AAS 25-727"),
    Choice("champion_27_fixed_sun", 27, "paper", "fixed", "0.398", "99.2 %", "0.0 %",
           "0.401 m/s, 0.0 % outside", "a Sun above the chief at the start"),
    Choice("champion_fixed_sun", 225, "paper", "fixed", "0.453", "99.8 %", "0.0 %",
           "0.452 m/s, 0.0 % outside", "the same, fewer failures"),
    Choice("champion_leo", 15, "leo", "any", "0.796", "97.7 %", "0.3 %", "0.797 m/s, 98.0 %, 0.0 % outside",
           "a low orbit: flights ahead choose one of 4 tours"),
    Choice("champion_leo_rehearsed", 15, "leo", "any", "", "", "", "0.583 m/s, 98.6 %, 0.0 % outside",
           "less fuel: flights ahead choose one of 240 tours"),
    Choice("champion_afrl", 27, "afrl", "any", "0.470", "99.9 %", "0.0 %", "",
           "AFRL's inspection", "results/field.md"),
    Choice("champion_rso", 27, "rso", "any", "4.021", "93.1 %", "0.9 %", "",
           "bsk_rl's inspection", "results/field.md"),
)
# fmt: on


def rows() -> list[tuple[str, ...]]:
    """Return a row for each choice, under `HEADINGS`."""
    return [
        (
            *(each.controller, str(each.rules), each.world, each.sun),
            *(each.delta_v, each.success, each.outside, each.layer, each.purpose),
        )
        for each in CHOICES
    ]


def recommendations() -> str:
    """Return the recommendations as text, and which parts of the low-orbit controllers are no rules."""
    lines = ["which champion to take"]
    for each in CHOICES:
        alone = (f"{each.delta_v} m/s", f"success {each.success}", f"{each.outside} outside")
        measured = [", ".join(alone)] if each.delta_v else []
        measured += [f"with safety=filter or robust {each.layer}"] if each.layer else []
        lines += [
            f"  controller={each.controller} world={each.world} ({each.rules} rules, Sun {each.sun}): "
            f"{each.purpose}",
            f"      {'; '.join(measured)}",
        ]
    return "\n".join([*lines, LOW_ORBIT])


#: what is no rule where one signs rules
LOW_ORBIT: Final = (
    "In champion_leo the 15 rules say how much of a push to make. Where to is no rule: the tour is 20\n"
    "constants (tour_*_m), and which of its images it follows, flights ahead choose (rehearsal_tours)."
)
