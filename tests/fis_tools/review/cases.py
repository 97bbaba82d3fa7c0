"""What the page is tested with: controllers, flights of them, and its HTML taken to pieces."""

from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np

from fis_tools.engines.inference import Floats, infer
from fis_tools.formats.serialize import dump_json
from fis_tools.model import FuzzyController, FuzzySystem, Gaussian, Term, Variable, table_rules
from fis_tools.words.text import sentences
from telemetry import EpisodeWriter
from telemetry.file.metadata import FisDescription
from tests.fis_tools.sample_controllers import FORCE_TERMS, force, gaussian_terms

HOSTILE = (
    "</script><script>window.pwned = 1</script>",
    "<img src=x onerror=window.pwned=1>",
    '"><svg onload="window.pwned=1">',
    "{{ 7 * 7 }}${window.pwned=1}",
    "a&amp;b<!--<script>",
)


def system_of_125_rules(name: str = "many") -> FuzzySystem:
    inputs = tuple(Variable(word, "m", -1.0, 1.0, gaussian_terms(FORCE_TERMS, -1.0, 1.0)) for word in "xyz")
    words = [FORCE_TERMS[(i // 25 + i // 5 + 2 * i) % 5] for i in range(125)]
    return FuzzySystem(name, inputs, (force(),), table_rules(inputs, force(), words))


def hostile_controller() -> FuzzyController:
    """A controller whose every name and text would do harm if it were taken for more than text."""
    terms = tuple(Term(word, Gaussian(float(place), 0.7)) for place, word in enumerate(HOSTILE))
    source = Variable(HOSTILE[0], HOSTILE[1], 0.0, 4.0, terms, description=HOSTILE[2])
    other = Variable(HOSTILE[3], HOSTILE[4], 0.0, 4.0, terms, description=HOSTILE[0])
    output = Variable(HOSTILE[1], HOSTILE[0], 0.0, 4.0, terms, default=0.0, description=HOSTILE[1])
    consequents = [HOSTILE[place % 5] for place in range(25)]
    rules = tuple(
        replace(rule, label=f"{HOSTILE[place % 5]} {place}")
        for place, rule in enumerate(table_rules((source, other), output, consequents))
    )
    system = FuzzySystem(HOSTILE[0], (source, other), (output,), rules)
    return FuzzyController(HOSTILE[0], (system,), ((HOSTILE[1], HOSTILE[2]),), ((HOSTILE[3], HOSTILE[0]),))


def path_of(system: FuzzySystem, num_samples: int) -> Floats:
    """Inputs that swing over the universes, a little beyond them too."""
    phases = np.linspace(0.0, 9.0, num_samples)
    columns = []
    for place, variable in enumerate(system.inputs):
        middle, half = (
            0.5 * (variable.maximum + variable.minimum),
            0.55 * (variable.maximum - variable.minimum),
        )
        columns.append(middle + half * np.sin((1.0 + 0.7 * place) * phases + place))
    return np.stack(columns, axis=1)


def log_flight(path: Path, controller: FuzzyController, num_samples: int) -> Path:
    """Log what every system of a controller does along `path_of`, every 10 s."""
    metadata = {f"fis.{system.name}": _description(system) for system in controller.systems}
    attachments = {"controller.json": dump_json(controller).encode()}
    path.parent.mkdir(parents=True, exist_ok=True)
    paths = [path_of(system, num_samples) for system in controller.systems]
    with EpisodeWriter(path, metadata=metadata, attachments=attachments) as writer:
        for sample in range(num_samples):
            for system, inputs in zip(controller.systems, paths, strict=True):
                step = infer(system, inputs[sample])
                writer.fis(10.0 * sample, system.name, inputs[sample], step.firing_strengths, step.values[0])
    return path


def _description(system: FuzzySystem) -> dict[str, str]:
    return FisDescription(
        input_names=tuple(variable.name for variable in system.inputs),
        input_units=tuple(variable.unit for variable in system.inputs),
        output_name=system.outputs[0].name,
        output_unit=system.outputs[0].unit,
        rules=tuple(sentences(system)),
    ).to_metadata()


class Markup(HTMLParser):
    """A page taken to pieces: its tags with attributes; that they match is asserted."""

    VOID = frozenset(("meta", "link", "br", "img", "hr", "input"))

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []
        self.stack: list[str] = []
        self.feed(text)
        self.close()
        assert self.stack == []

    def handle_starttag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        assert len({name for name, _ in attrs}) == len(attrs)
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.stack.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.stack.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append((self.stack[-1] if self.stack else "", data))

    def values(self, name: str) -> list[str]:
        """All values of an attribute."""
        return [attributes[name] or "" for _, attributes in self.tags if name in attributes]
