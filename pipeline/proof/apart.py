"""The checker of a proof as another program runs it: in a process of its own, which limits its memory."""

import io
import sys
from importlib.util import find_spec
from pathlib import Path

from pipeline.run import maker


class _Answer:
    """What the checker prints on standard error, passed on, and why it refuses a proof, if so."""

    refusal = ""

    def write(self, line: str) -> None:
        """Hold a line back until `flush`."""
        mark, refused, reason = line.partition("refused: ")
        if refused and not mark:
            self.refusal = reason.strip()
        else:
            sys.stderr.write(f"  {line}")

    def flush(self) -> None:
        """Pass on what is held back."""
        sys.stderr.flush()


def is_installed() -> bool:
    """Return whether the checker can run: it needs an extra."""
    return find_spec("flint") is not None


def check_apart(folder: Path) -> str:
    """Check the proof of a run's folder; return why it is refused, empty if it is not."""
    answer = _Answer()
    words = ["-m", "pipeline.proof.check", str(folder.absolute())]
    code = maker.run_child(words, {}, io.StringIO(), answer)
    return (answer.refusal or f"it ended with code {code}") if code else ""
