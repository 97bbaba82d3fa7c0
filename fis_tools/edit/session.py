"""What one page edits: a controller, its history, and what changed since it was opened."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from fis_tools.findings.difference import Difference, difference
from fis_tools.findings.difference.report import TO, headline, shape_change
from fis_tools.formats.files import written
from fis_tools.formats.serialize import checked, fingerprint
from fis_tools.model import FuzzyController
from fis_tools.model.validate import InvalidSystem, controller_problems
from fis_tools.words.text import listed, sentence

#: the fact that says what a hand changed, and from which content
EDITED_FROM = "edited_from"
#: changes of a kind that a saved copy tells one by one
MOST_TOLD = 4


class NotSaved(ValueError):  # noqa: N818
    """A copy that is not written; the text says why and what to do."""


class Session:
    """A controller that is edited, step by step; controllers are immutable, so its history is a list.

    Parameters
    ----------
    path : Path
        What it was read from.
    original : FuzzyController
        Without problems.
    """

    def __init__(self, path: Path, original: FuzzyController) -> None:
        self.path, self.original = path, original
        self._history, self._place = [original], 0
        self._gesture: object = None

    @property
    def controller(self) -> FuzzyController:
        """The controller as it stands."""
        return self._history[self._place]

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to take back."""
        return self._place > 0

    @property
    def can_redo(self) -> bool:
        """Whether a step was taken back."""
        return self._place + 1 < len(self._history)

    def touch(self, change: Callable[[FuzzyController], FuzzyController], gesture: object = None) -> None:
        """Take a step; those of one gesture, such as a drag, are one step to undo.

        Raises
        ------
        InvalidSystem
            If the result has problems; nothing changes then.
        """
        changed = change(self.controller)
        if problems := controller_problems(changed):
            raise InvalidSystem(problems[0])
        if changed == self.controller:
            return
        keep = self._place + (0 if gesture is not None and gesture == self._gesture else 1)
        self._history[keep:] = [changed]
        self._place, self._gesture = keep, gesture

    def undo(self) -> None:
        """Take the last step back."""
        self._place, self._gesture = max(0, self._place - 1), None

    def redo(self) -> None:
        """Take the step again that was taken back last."""
        self._place, self._gesture = min(self._place + 1, len(self._history) - 1), None

    def proposed(self) -> Path:
        """Return a place for a copy where no file is."""
        folder = self.path if self.path.is_dir() else self.path.parent
        for number in range(1, 1000):
            name = f"{self.original.name}-edited{'' if number == 1 else f'-{number}'}.yaml"
            if not (folder / name).exists():
                return folder / name
        return folder / "edited.yaml"

    def copy(self) -> FuzzyController:
        """Return the controller with what was changed by hand as a fact of its provenance."""
        if self.controller == self.original:
            return self.original
        told = f"{fingerprint(self.original)}: {changes_in_words(difference(self.original, self.controller))}"
        facts = dict(self.controller.provenance) | {EDITED_FROM: told}
        return checked(replace(self.controller, provenance=tuple(sorted(facts.items()))))

    def save(self, place: Path, replaces: bool) -> list[str]:
        """Write a copy, in the form that its ending says; return what was written, and what was lost.

        Raises
        ------
        NotSaved
            If there is a file already and it is not to be replaced, or the form cannot hold the controller.
        """
        try:
            files = written(self.copy(), place)
        except ValueError as error:
            raise NotSaved(str(error)) from error
        there = [str(path) for path in files if path.exists()]
        if there and not replaces:
            raise NotSaved(
                f"{listed(there)} is there already; choose another name, or tick that it is replaced"
            )
        for path, file in files.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(file.content)
        return [f"wrote {path}" for path in files] + [loss for file in files.values() for loss in file.losses]


def changes_in_words(found: Difference) -> str:
    """Say on one line what changed."""
    if found.is_empty:
        return "nothing changed"
    words = [f"{fact.what} {fact.before} {TO} {fact.after}" for fact in found.facts]
    for system in found.systems:
        if system.is_empty:
            continue
        told = [
            f"{variable.present.name} {term.present.name} {shape_change(term.before, term.after)}"
            for variable in system.variables
            for term in variable.terms
            if term.before is not None and term.after is not None
        ]
        for change in system.rules:
            sides = [sentence(rule) for rule in (change.before, change.after) if rule is not None]
            told.append(f"rule {change.number}: {f' {TO} '.join(sides)}")
        words.append(
            f"{system.present.name}: {headline(system)}" + (f" ({listed(told, MOST_TOLD)})" if told else "")
        )
    return "; ".join(words)
