"""Earlier runs that judged the same controller by the same requirements, so that repeating is visible."""

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from fis_tools.file_access import read_bytes
from pipeline.run import artifacts

#: so many folders beside a run are looked into, the newest
MOST_FOLDERS = 100
#: larger evidence is none
MOST_BYTES = 64 * 1024**2
#: conditions that tell repeated flights from the first ones
DRAWN = ("seed", "num_cases")


def earlier_runs(folder: Path, evidence: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return earlier runs beside a run that judged the same by other random flights, the oldest first.

    Parameters
    ----------
    folder : Path
        Of the run.
    evidence : mapping
        The run's own, as plain data.

    Returns
    -------
    list of dict
        With ``folder``, its name, ``seed``, ``num_cases``, and ``verdicts``, by the ids of requirements. Runs
        that cannot be read are left out.
    """
    dated = []
    with suppress(OSError):
        for path in folder.resolve().parent.iterdir():
            if path.name != folder.resolve().name and not path.is_symlink():
                with suppress(OSError):
                    dated.append(((path / artifacts.EVIDENCE).stat().st_mtime, path))
    runs = []
    for _, path in sorted(dated)[-MOST_FOLDERS:]:
        with suppress(OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
            other = json.loads(read_bytes(path / artifacts.EVIDENCE, MOST_BYTES))
            if _question(other) == _question(evidence) and _flights(other) != _flights(evidence):
                verdicts = {entry["id"]: str(entry["verdict"]) for entry in other["requirements"]}
                runs.append({"folder": path.name, **_flights(other), "verdicts": verdicts})
    return runs


def _question(evidence: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return what a run judged: controller, requirements and conditions, without the random draw."""
    conditions = {key: value for key, value in evidence["conditions"].items() if key not in DRAWN}
    # as JSON holds them
    values = [list(value) if isinstance(value, tuple) else value for value in conditions.values()]
    return evidence["controller"], evidence["sha256"][artifacts.REQUIREMENTS], list(conditions), values


def _flights(evidence: Mapping[str, Any]) -> dict[str, Any]:
    """Return the seed and the number of cases of a run."""
    return {key: evidence["conditions"][key] for key in DRAWN}


def repeats_in_words(evidence: Mapping[str, Any]) -> str:
    """Return the verdicts of earlier runs in a few sentences, empty without any."""
    runs = evidence["earlier"]
    verdicts = {entry["id"]: entry["verdict"] for entry in evidence["requirements"]}
    if not runs:
        return ""
    words, gained = [], set()
    for run in runs:
        differing = {name: word for name, word in run["verdicts"].items() if word != verdicts.get(name)}
        gained |= {name for name in differing if str(verdicts.get(name)).startswith("shown")}
        words_of_run = ", ".join(f"{name} {word}" for name, word in differing.items()) or "the same verdicts"
        words.append(f"{run['folder']} (seed {run['seed']}, {run['num_cases']:,} cases): {words_of_run}")
    count = "An earlier run" if len(runs) == 1 else f"{len(runs)} earlier runs"
    text = f"{count} beside this one judged the same by other flights. {'; '.join(words)}."
    if gained:
        names = ", ".join(sorted(gained))
        text += f" {names}: what is repeated until it is shown does not have the confidence that is stated."
    return text
