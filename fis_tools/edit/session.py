"""What one page edits: a controller, its history, and what changed since it was opened."""

from collections.abc import Callable
from itertools import chain, count
from pathlib import Path

from fis_tools.findings.difference import Difference, difference
from fis_tools.findings.difference.report import TO, headline, shape_change
from fis_tools.formats.files import file_name, written
from fis_tools.formats.serialize import checked, fingerprint, original_name, renamed
from fis_tools.model import FuzzyController
from fis_tools.model.validate import InvalidSystem, controller_problems
from fis_tools.words.text import listed, sentence
from plain_files.file_access import sync_folder, write_bytes

#: the fact that says what a hand changed, and from which content
EDITED_FROM = "edited_from"
#: changes of a kind that a saved copy tells one by one
MOST_TOLD = 4
#: of a controller's name in a proposed file's, whose most are 255
MOST_NAME_BYTES = 150


class Session:
    """A controller that is edited, step by step; controllers are immutable, so its history is a list.

    Parameters
    ----------
    path : Path
        What it was read from.
    original : FuzzyController
        Without problems.
    check : callable, optional
        Raises ValueError for a controller that is refused, though it has no problems.
    describe : callable, optional
        Returns a controller that was changed with descriptions that follow what it became.
    """

    def __init__(
        self,
        path: Path,
        original: FuzzyController,
        check: Callable[[FuzzyController], object] | None = None,
        describe: Callable[[FuzzyController], FuzzyController] = lambda controller: controller,
    ) -> None:
        self.path, self.original, self._check, self._describe = path, original, check, describe
        #: called by whoever changes it: the pages that show it
        self.views: list[Callable[[], None]] = []
        self._history, self._place = [original], 0
        self._gesture: object = None
        self._saved = original

    @property
    def controller(self) -> FuzzyController:
        """The controller as it stands."""
        return self._history[self._place]

    @property
    def is_unsaved(self) -> bool:
        """Whether the controller differs from the one that was opened or saved last."""
        return self.controller != self._saved

    def can_step(self, direction: int) -> bool:
        """Whether there is a step to take back (-1), or one that was taken back (1)."""
        return 0 <= self._place + direction < len(self._history)

    def step(self, direction: int) -> None:
        """Take the last step back (-1), or the step again that was taken back last (1)."""
        if self.can_step(direction):
            self._place, self._gesture = self._place + direction, None

    def touch(self, change: Callable[[FuzzyController], FuzzyController], gesture: object = None) -> None:
        """Take a step; those of one gesture, such as a drag, are one step to undo.

        Raises
        ------
        ValueError
            If the result has problems or is refused; nothing changes then.
        """
        changed = change(self.controller)
        if problems := controller_problems(changed):
            raise InvalidSystem(problems[0])
        if changed == self.controller:
            return
        changed = self._describe(changed)
        if self._check is not None:
            self._check(changed)
        keep = self._place + (0 if gesture is not None and gesture == self._gesture else 1)
        self._history[keep:] = [changed]
        self._place, self._gesture = keep, gesture

    def proposed(self) -> Path:
        """Return a place for a copy where no file is."""
        folder = self.path if self.path.is_dir() else self.path.parent
        # the name of a controller is any text
        stem = (
            file_name(original_name(self.original)).encode()[:MOST_NAME_BYTES].decode(errors="ignore")
            + "-edited"
        )
        names = chain([stem], (f"{stem}-{number}" for number in count(2)))
        return next(path for name in names if not (path := folder / f"{name}.yaml").exists())

    def copy(self) -> FuzzyController:
        """Return the controller with what was changed by hand as a fact of its provenance."""
        if self.controller == self.original:
            return self.original
        edit = f"{fingerprint(self.original)}: {changes_in_words(difference(self.original, self.controller))}"
        return renamed(checked(self.controller.with_provenance({EDITED_FROM: edit})))

    @property
    def title(self) -> str:
        """Name of the controller as it stands."""
        return (self.original if self.controller == self.original else renamed(self.controller)).name

    def save(self, target: Path, replaces: bool) -> list[str]:
        """Write a copy, in the form that its ending says; return what was written, and what was lost.

        Raises
        ------
        ValueError
            If there is a file already and it is not to be replaced, or the form cannot hold the controller.
        """
        files = written(self.copy(), target)
        existing = [str(path) for path in files if path.exists()]
        if existing and not replaces:
            raise ValueError(
                f"{listed(existing)} is there already; choose another name, or tick the box to replace it"
            )
        for path, file in files.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(path, file.content)
        for folder in {path.parent for path in files}:
            sync_folder(folder)
        self._saved = self.controller
        return [f"wrote {path}" for path in files] + [loss for file in files.values() for loss in file.losses]


def changes_in_words(differences: Difference) -> str:
    """Say on one line what changed."""
    if differences.is_empty:
        return "nothing changed"
    words = [f"{fact.what} {fact.before} {TO} {fact.after}" for fact in differences.facts]
    for system in differences.systems:
        if system.is_empty:
            continue
        how = [
            f"{variable.present.name} {term.present.name} {shape_change(term.before, term.after)}"
            for variable in system.variables
            for term in variable.terms
            if term.before is not None and term.after is not None
        ]
        for change in system.rules:
            sides = [sentence(rule) for rule in (change.before, change.after) if rule is not None]
            how.append(f"rule {change.number}: {f' {TO} '.join(sides)}")
        words.append(
            f"{system.present.name}: {headline(system)}" + (f" ({listed(how, MOST_TOLD)})" if how else "")
        )
    return "; ".join(words)
