"""How a command ends: exit codes, and what is said of errors."""

from collections.abc import Iterable

from fis_tools.errors import MissingExtra

#: exit codes; from the fourth on: a proof asked for was not found, training gained nothing, a fit misses its
#: goal, Ctrl-C
OK, FAULT, MISTAKE, UNPROVED, UNIMPROVED, MISSED, INTERRUPTED = 0, 1, 2, 3, 4, 5, 130
#: errors of the user's
MISTAKES = (ValueError, OSError, MemoryError, MissingExtra)


def error_sentence(error: Exception) -> str:
    """Return the message of an error; one for lack of memory has none of its own."""
    if not isinstance(error, MemoryError):
        return str(error)
    return (
        "there is not enough memory for this; lower monte_carlo.num_cases, optimizer.population_size or "
        "duration_s, or lengthen control_period_s"
    )


def error_text(error: Exception) -> str:
    """Return the message of a user error, with its notes."""
    return "\n".join([f"error: {error_sentence(error)}", *getattr(error, "__notes__", ())]) + "\n"


def most_telling(codes: Iterable[int]) -> int:
    """Return the exit code for several runs: a failure's, else that of one that lacks something, else 0."""
    return max(codes, key=(OK, UNPROVED, UNIMPROVED, MISSED, FAULT, MISTAKE).index, default=OK)
