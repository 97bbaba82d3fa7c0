"""What the page is tested with: controllers, flights of them, and what a page shows."""

import hashlib
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from fis_tools.engines.inference import Floats
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, FuzzySystem, Gaussian, Term, Variable, table_rules
from fis_tools.review import page
from tests.fis_tools.analysis.test_flights import log_along
from tests.fis_tools.sample_controllers import SHIPPED
from tests.fis_tools.step_by_step import ends

HOSTILE = (
    "</script><script>window.pwned = 1</script>",
    "<img src=x onerror=window.pwned=1>",
    '"><svg onload="window.pwned=1">',
    "{{ 7 * 7 }}${window.pwned=1}",
    "a&amp;b<!--<script>",
)


def hostile_controller() -> FuzzyController:
    """A controller whose every name and text would do harm if it were taken for more than text."""
    terms = tuple(Term(word, Gaussian(float(index), 0.7)) for index, word in enumerate(HOSTILE))
    source = Variable(HOSTILE[0], HOSTILE[1], 0.0, 4.0, terms, description=HOSTILE[2])
    other = Variable(HOSTILE[3], HOSTILE[4], 0.0, 4.0, terms, description=HOSTILE[0])
    output = Variable(HOSTILE[1], HOSTILE[0], 0.0, 4.0, terms, default=0.0, description=HOSTILE[1])
    consequents = [HOSTILE[index % 5] for index in range(25)]
    rules = tuple(
        replace(rule, label=f"{HOSTILE[index % 5]} {index}")
        for index, rule in enumerate(table_rules((source, other), output, consequents))
    )
    system = FuzzySystem(HOSTILE[0], (source, other), (output,), rules)
    return FuzzyController(HOSTILE[0], (system,), ((HOSTILE[1], HOSTILE[2]),), ((HOSTILE[3], HOSTILE[0]),))


def path_of(system: FuzzySystem, num_samples: int) -> Floats:
    """Inputs that swing over the universes, a little beyond them too."""
    phases = np.linspace(0.0, 9.0, num_samples)[:, np.newaxis]
    low, high = ends(system)
    indices = np.arange(len(low))
    swings: Floats = np.sin((1.0 + 0.7 * indices) * phases + indices)
    return 0.5 * (high + low) + 0.55 * (high - low) * swings


def log_flight(path: Path, controller: FuzzyController, num_samples: int) -> Path:
    """Log what every system of a controller does along `path_of`, every 10 s."""
    paths = [path_of(system, num_samples) for system in controller.systems]
    return log_along(path, controller, zip(*paths, strict=True))


NUM_SAMPLES = 120
CHAMPION = serialize.load(SHIPPED["champion_any_sun"])
DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


def written(*arguments, **options) -> str:
    """The page with all that it folds opened, as one who clicks would have it."""
    folded = page.write(*arguments, **options)
    return re.sub(r"<details( class=.part.)?>", r"<details\1 open>", folded)


def number(words: str) -> float:
    return float(words.replace("−", "-"))


def number_after(words: str, name: str) -> float:
    match = re.search(rf"{name} = ([−\d.e+-]+)", words)
    assert match, words
    return number(match[1])


def at_share(variable: Variable, share: float) -> float:
    return variable.minimum + share * (variable.maximum - variable.minimum)


def state(shown, index: int = 0) -> np.ndarray:
    """The inputs of a system as the page holds them."""
    return np.array(shown.evaluate(f"review.states[{index}].inputs"))


def pixels(shown, selector: str) -> str:
    """What is drawn on a canvas, once it has been drawn."""
    shown.locator(selector).scroll_into_view_if_needed()
    for _ in range(3):
        shown.evaluate(DRAWN)
    content = shown.locator(selector).evaluate("(canvas) => canvas.toDataURL()")
    return hashlib.sha256(content.encode()).hexdigest()
