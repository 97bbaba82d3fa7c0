"""All tries of a claim: a ledger in each run's folder, found again wherever it stands, and what they cost.

A claim that flights show has a risk, one minus its confidence. All tries of it share this risk, so that
trying until it is shown does not help: each try's number of cases is fixed beforehand, it is judged by cases
alone that no earlier try flew, and spends what a test of so many cases risks; what follows may spend half of
what is left. Flights that end by themselves spend half, and more flights of their seed are the same try. By
Bonferroni's inequality the sum holds for any number of tries (Lan and DeMets, "Discrete sequential boundaries
for clinical trials", Biometrika 70, 1983).
"""

import json
import os
import sys
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from pipeline.evaluation.assurance.judgements import Tried, failures_allowed
from pipeline.evaluation.assurance.requirements import Requirement
from pipeline.run import artifacts, sweep, writing
from plain_files.file_access import read_bytes
from plain_files.plain_text import parse_json

#: folders that are looked into, those nearest to the top first
MOST_FOLDERS: Final = 20_000
#: larger evidence is none
MOST_BYTES: Final = 64 * 1024**2
#: the folder that runs stand in, unless the user says otherwise
OUTPUTS: Final = "outputs"
#: conditions that tell repeated flights from the first ones
DRAWN: Final = ("seed", "num_cases", "stop_width")


@dataclass(frozen=True)
class Try:
    """An earlier try of the claims of some requirements.

    Parameters
    ----------
    folder : str
        Below the folder that was searched.
    seed, num_cases : int
    verdicts : mapping of str to str
        By the ids of requirements.
    by_cases, by_splitting : mapping of str to str
        By formula: the verdict of the flights alone, and that of splitting.
    is_sequential : bool
        Whether the flights themselves decided when they end.
    """

    folder: str
    seed: int
    num_cases: int
    verdicts: Mapping[str, str]
    by_cases: Mapping[str, str]
    by_splitting: Mapping[str, str] = field(default_factory=dict)
    is_sequential: bool = False

    @property
    def flights(self) -> "Flights":
        """What tells its flights from those of other tries."""
        return flights_of(self.seed, self.num_cases, is_sequential=self.is_sequential)


#: a seed and a number of cases; 0 for flights that end by themselves: more of them are the same try
Flights = tuple[int, int]


def flights_of(seed: int, num_cases: int, *, is_sequential: bool) -> Flights:
    """Return what tells the flights of a try from those of others."""
    return seed, 0 if is_sequential else num_cases


def searched_folder(folder: Path) -> Path:
    """Return the folder below which tries are looked for.

    It is the outermost folder around a run that holds a sweep or other evidence, is called ``outputs``, or is
    the working directory; at least the one that the run stands in.
    """
    around = folder.resolve().parents
    outer = [path for path in around if path in (Path.cwd(), around[0]) or _holds_runs(path)]
    return min(outer, key=lambda path: len(path.parts))


def _holds_runs(folder: Path) -> bool:
    """Return whether runs are to be expected in a folder."""
    if folder.name == OUTPUTS or (folder / sweep.SWEEP).is_file() or (folder / artifacts.EVIDENCE).is_file():
        return True
    with suppress(OSError), os.scandir(folder) as inside:
        return any(Path(item.path, artifacts.EVIDENCE).is_file() for item in inside if not item.is_symlink())
    return False


def earlier_tries(folder: Path, subject: Mapping[str, Any]) -> list[Try]:
    """Return the tries that judged the same controller under the same conditions, the oldest first.

    Parameters
    ----------
    folder : Path
        Of the run, whose own ledger counts, too.
    subject : mapping
        With the ``controller`` and the ``conditions`` of the evidence.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the ledger of this run cannot be read: it must not be forgotten.
    """
    top, dated = searched_folder(folder), []
    for path in _folders(top):
        is_this = path == folder.resolve()
        name = "this run" if is_this else path.relative_to(top).as_posix()
        try:
            for number, entry in enumerate(_entries(path)):
                if _question(entry) == _question(subject):
                    dated.append((_date(path), name, number, _try_of(entry, name)))
        except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            if is_this and (path / artifacts.LEDGER).exists():
                raise artifacts.ArtifactError(
                    f"{folder / artifacts.LEDGER} cannot be read, and what was tried must not be forgotten; "
                    "restore it, or start a new run"
                ) from error
            sys.stderr.write(f"  note: what {name} has tried cannot be read, and does not count\n")
    return [entry for *_, entry in sorted(dated, key=lambda item: item[:3])]


def _folders(top: Path) -> Iterator[Path]:
    """Yield the folders with evidence below one, links not followed, those nearest to it first."""
    waiting, count = deque([top]), 0
    while waiting:
        path, count = waiting.popleft(), count + 1
        if count > MOST_FOLDERS:
            sys.stderr.write(f"  note: earlier tries are sought in {MOST_FOLDERS:,} folders alone\n")
            return
        with suppress(OSError), os.scandir(path) as inside:
            names = sorted(item.name for item in inside if item.is_dir(follow_symlinks=False))
            if artifacts.ASSURANCE in names:
                yield path
            waiting += [path / name for name in names if not name.startswith(".")]


def _date(folder: Path) -> float:
    names = (artifacts.LEDGER, artifacts.EVIDENCE)
    return next((folder / name).stat().st_mtime for name in names if (folder / name).exists())


def _entries(folder: Path) -> list[dict[str, Any]]:
    """Return the entries of a run's ledger; earlier versions have their evidence alone."""
    if (folder / artifacts.LEDGER).exists():
        content = read_bytes(folder / artifacts.LEDGER, MOST_BYTES)
        return [parse_json(line) for line in content.splitlines()]
    if (folder / artifacts.EVIDENCE).exists():
        return [entry_of(parse_json(read_bytes(folder / artifacts.EVIDENCE, MOST_BYTES)))]
    return []


def entry_of(evidence: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the ledger keeps of evidence."""
    claims = [
        {
            "id": str(entry["id"]),
            "formula": entry.get("formula"),
            "probability": entry.get("probability"),
            "confidence": entry.get("confidence"),
            "verdict": str(entry["verdict"]),
            "by_cases": entry.get("methods", {}).get("cases", {}).get("verdict"),
            "by_splitting": entry.get("methods", {}).get("splitting", {}).get("verdict"),
        }
        for entry in evidence["requirements"]
    ]
    subject = {name: evidence[name] for name in ("controller", "conditions")}
    entry: dict[str, Any] = json.loads(json.dumps({**subject, "claims": claims}))
    return entry


def append(folder: Path, evidence: Mapping[str, Any]) -> None:
    """Append evidence to the ledger of its run; what stands there stays; the same again adds nothing."""
    entry, path = entry_of(evidence), folder / artifacts.LEDGER
    entries = _entries(folder) if path.exists() else []
    if entry not in entries:
        before = read_bytes(path, MOST_BYTES) if entries else b""
        line = json.dumps(entry, ensure_ascii=False, sort_keys=True)
        writing.write_atomically(path, before + f"{line}\n".encode())


def seed_ledger(folder: Path) -> None:
    """Keep the evidence of an earlier version, which has no ledger, before it is replaced."""
    if (folder / artifacts.EVIDENCE).exists() and not (folder / artifacts.LEDGER).exists():
        with suppress(ValueError, LookupError, TypeError, AttributeError, RecursionError):
            append(folder, parse_json(read_bytes(folder / artifacts.EVIDENCE, MOST_BYTES)))


def _try_of(entry: Mapping[str, Any], folder: str) -> Try:
    claims = entry["claims"]
    return Try(
        folder,
        int(entry["conditions"]["seed"]),
        int(entry["conditions"]["num_cases"]),
        {str(claim["id"]): str(claim["verdict"]) for claim in claims},
        _verdicts(claims, "by_cases"),
        _verdicts(claims, "by_splitting"),
        "stop_width" in entry["conditions"],
    )


def _verdicts(claims: Sequence[Mapping[str, Any]], by: str) -> dict[str, str]:
    """Return the verdicts of claims by a method, by formula."""
    return {_formula(claim["formula"]): str(claim[by]) for claim in claims if claim.get(by)}


def _formula(text: str | None) -> str:
    """Return a formula without its spaces."""
    return "".join(str(text or "").split())


def _question(evidence: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return what a run judged: controller and conditions, without the random draw."""
    conditions = {key: value for key, value in evidence["conditions"].items() if key not in DRAWN}
    controller = evidence["controller"]
    return controller["sha256"] or controller["name"], json.dumps(conditions, sort_keys=True)


def tried(
    requirement: Requirement, flights: Flights, tries: Sequence[Try], num_flown: int | None = None
) -> Tried:
    """Return what earlier tries leave of a claim.

    Parameters
    ----------
    requirement : Requirement
    flights : (int, int)
        Of the present try, see `flights_of`.
    tries : sequence of Try
    num_flown : int, optional
        Cases of flights that ended by themselves.
    """
    formula = _formula(requirement.formula_text)
    same = [entry for entry in tries if formula in entry.by_cases]
    refuting = [entry for entry in same if entry.by_cases[formula] == "refuted" and entry.flights != flights]
    # the same flights again are judged as they were the first time
    first = next((index for index, entry in enumerate(same) if entry.flights == flights), len(same))
    left = risk = 1.0 - requirement.confidence
    known, counted = dict[int, int](), set[Flights]()
    for entry in same[:first]:
        num_before = known.get(entry.seed, 0)
        known[entry.seed] = max(entry.num_cases, num_before)
        if entry.flights not in counted:
            num_new = known[entry.seed] - num_before
            # an interval for any number of flights spends all that it is given
            left -= (
                left / 2
                if entry.is_sequential
                else _risk_of(num_new, requirement.probability, left if left == risk else left / 2)
            )
            counted.add(entry.flights)
    is_sequential, num_cases = flights[1] == 0, num_flown if num_flown is not None else flights[1]
    return Tried(
        num_tries=len({entry.flights for entry in same[:first]}),
        num_known=min(known.get(flights[0], 0), num_cases),
        risk=left if left == risk and not is_sequential else left / 2,
        refuted_by=f"{refuting[0].folder} ({_cases_in_words(refuting[0])})" if refuting else "",
    )


def splitting_risk(requirement: Requirement, flights: Flights, tries: Sequence[Try]) -> float:
    """Return the risk that splitting may spend: half of what earlier tries of the claim left.

    Its interval spends all that it is given, so that even the first leaves half to others.
    """
    formula = _formula(requirement.formula_text)
    before = list(dict.fromkeys(entry.flights for entry in tries if formula in entry.by_splitting))
    number = before.index(flights) if flights in before else len(before)
    return (1.0 - requirement.confidence) / 2.0 ** (number + 1)


def _risk_of(num_cases: int, probability: float, risk: float) -> float:
    """Return how likely a test of so many cases shows a claim that is just not true."""
    from scipy.special import bdtr  # noqa: PLC0415 - slower to import than a thousand flights

    allowed = failures_allowed(num_cases, probability, 1.0 - risk)
    return float(bdtr(allowed, num_cases, 1.0 - probability)) if allowed >= 0 else 0.0


def listed(tries: Sequence[Try], flights: Flights) -> list[dict[str, Any]]:
    """Return the tries by other flights as plain data."""
    names = ("folder", "seed", "num_cases", "verdicts")
    return [{name: getattr(entry, name) for name in names} for entry in tries if entry.flights != flights]


def _cases_in_words(entry: Try) -> str:
    return f"seed {entry.seed}, {entry.num_cases:,} cases"


def repeats_in_words(evidence: Mapping[str, Any]) -> str:
    """Return the verdicts of other tries in a few sentences, empty without any."""
    runs = evidence["earlier"]
    verdicts = {entry["id"]: entry["verdict"] for entry in evidence["requirements"]}
    if not runs:
        return ""
    words = []
    for run in runs:
        differing = {name: word for name, word in run["verdicts"].items() if word != verdicts.get(name)}
        words_of_run = ", ".join(f"{name} {word}" for name, word in differing.items()) or "the same verdicts"
        words.append(f"{run['folder']} (seed {run['seed']}, {run['num_cases']:,} cases): {words_of_run}")
    count = "Another try" if len(runs) == 1 else f"{len(runs)} other tries"
    return (
        f"{count} judged the same controller under the same conditions by other flights. {'; '.join(words)}. "
        "Tries of a claim share its risk: each counts the cases alone that no earlier one flew, and spends a "
        "part of what is left of one minus the confidence."
    )
