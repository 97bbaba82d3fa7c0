"""Requirements from a file: their identity, methods of verification and confidence."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

from pipeline.evaluation.assurance.formula import Formula, FormulaError, parse, quantities_of, unit_of
from pipeline.evaluation.assurance.quantities import is_of_fleets, units_for
from pipeline.evaluation.assurance.robustness import idle_window, late_window
from pipeline.run import configuration
from pipeline.settings.experiment import Mission
from pipeline.settings.keys import choices_of, did_you_mean, value_at
from pipeline.settings.monte_carlo import MonteCarlo
from pipeline.settings.places import requirements_path
from plain_files.file_access import read_text

SCHEMA: Final = ("requirements", 2)
#: methods of verification: many flights, splitting for rare failures, a search for the worst case, boxes of
#: inputs that bound the systems' outputs, the proof of the safety layer, and a tube of all starts
CASES, SPLITTING, SEARCH, BOUNDS = "cases", "splitting", "search", "bounds"
SAFETY_LAYER, TUBE = "safety_layer", "tube"
METHODS: Final = (CASES, SPLITTING, SEARCH, BOUNDS, SAFETY_LAYER, TUBE)
#: those that enclose the starts of a single deputy, at rest or at any velocity of a box
OF_ONE_DEPUTY: Final = (TUBE,)
#: how bad a failure is, the worst first
SEVERITIES: Final = ("catastrophic", "critical", "marginal")
TEXTS: Final = ("title", "text", "consequence", "severity", "reason", "source")
OTHER_KEYS: Final = ("id", "verified_by", "formula", "probability", "confidence", "accepted", "bounds")

#: the least and the greatest confidence of a claim
CONFIDENCES: Final = (0.8, 0.9999)

ACCEPTANCE: Final = (
    "a share of catastrophic failures must be accepted in words: say who accepts it and why, or leave "
    "probability out, and only a proof shows the requirement"
)


#: a key in braces, which stands for its number
_NUMBER: Final = re.compile(r"\{([a-z][\w.]*)\}")


class RequirementError(ValueError):
    """A file of requirements that cannot be used; the text says where and why."""


@dataclass(frozen=True)
class Question:
    """Outputs that a system must not have in a region of its inputs, see `fis_tools.analysis.bounds.ask`."""

    ask: str
    where: str = ""


@dataclass(frozen=True)
class Requirement:
    """A condition on flights, or on a controller's systems.

    Parameters
    ----------
    id, title : str
    text : str
        The condition in a sentence.
    consequence : str
        What a failure means, such as "a collision".
    severity : str
        Of `SEVERITIES`.
    reason, source : str
        Why it is required, and where it comes from.
    verified_by : tuple of str
        Of `METHODS`.
    formula_text : str
        Empty for conditions on systems alone.
    formula : Formula, optional
    probability : float
        Share of the cases that must meet the formula; one if all must, which only a proof can show.
    confidence : float
        Required confidence of the demonstration.
    accepted : str
        Who accepts that share of catastrophic failures, and why.
    questions : tuple of Question
        Each must be answered with a proved no.
    """

    id: str
    title: str
    text: str
    consequence: str
    severity: str
    reason: str
    source: str
    verified_by: tuple[str, ...]
    formula_text: str = ""
    formula: Formula | None = None
    probability: float = 1.0
    confidence: float = 0.0
    accepted: str = ""
    questions: tuple[Question, ...] = ()

    @property
    def unit(self) -> str:
        """The unit of its margin: ``mixed`` for several units, empty if dimensionless."""
        unit = unit_of(self.formula) if self.formula else ""
        return "mixed" if unit is None else unit


@dataclass(frozen=True)
class Requirements:
    """A set of requirements and its name."""

    name: str
    requirements: tuple[Requirement, ...]


def load_requirements(name: str, mission: Mission) -> tuple[Requirement, ...]:
    """Load the requirements of a name that ships, or of a file, for a mission.

    Raises
    ------
    RequirementError, OSError
        If there are none, or they cannot be read.
    """
    return parse_requirements(requirements_text(name, mission), name).requirements


def requirements_text(name: str, mission: Mission) -> str:
    """Return the text of the requirements of a name that ships, or of a file, with a mission's numbers.

    A number stands for its key in braces, such as ``{deputy.min_distance_m}``: so a mission's own limits are
    those that are judged.

    Raises
    ------
    RequirementError
        If there is no such number.
    OSError
        If there are no such requirements.
    """
    settings = asdict(mission)

    def number(braces: re.Match[str]) -> str:
        value = value_at(settings, key := braces[1])
        if isinstance(value, bool) or not isinstance(value, int | float):
            named = ", ".join(f"{{{each}}}" for each in ("deputy.max_distance_m", "duration_s"))
            raise RequirementError(
                f"{name}: {{{key}}} is no number of the mission; braces hold the key of one, such as {named}"
            )
        return repr(value).removesuffix(".0")

    return _NUMBER.sub(number, read_text(requirements_path(name)))


def parse_requirements(text: str, source: str) -> Requirements:
    """Parse a set of requirements from YAML.

    Parameters
    ----------
    text : str
    source : str
        Name of the file in messages.

    Raises
    ------
    RequirementError
    """
    try:
        content = configuration.parse(text.encode())
    except ValueError as error:
        why = " ".join(str(error).split())
        raise RequirementError(f"{source} is no YAML: {why}; correct it there") from error
    if not isinstance(content, dict) or (content.get("schema"), content.get("schema_version")) != SCHEMA:
        raise RequirementError(
            f"{source} holds no requirements; its first lines must say schema: {SCHEMA[0]} and "
            f"schema_version: {SCHEMA[1]} (version 1 lacked consequence, severity, reason and source)"
        )
    entries = content.get("requirements")
    if not isinstance(entries, list) or not entries or not all(isinstance(entry, dict) for entry in entries):
        raise RequirementError(f"{source}: requirements must be a list of at least one, each with an id")
    requirements = tuple(
        _requirement(entry, f"{source}, requirement {n}") for n, entry in enumerate(entries, 1)
    )
    names = [entry.id for entry in requirements]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise RequirementError(f"{source}: {twice} is the id of two requirements; give each its own")
    return Requirements(str(content.get("name", source)), requirements)


def _requirement(entry: Mapping[str, Any], where: str) -> Requirement:
    """Return the requirement that an entry of the file states; raise RequirementError for faulty entries."""
    for key in entry:
        if key not in (known := (*OTHER_KEYS, *TEXTS)):
            raise RequirementError(f"{where}: there is no key {key}{did_you_mean(str(key), known)}")
    name = _text(entry, "id", where)
    if not name.replace("-", "_").isidentifier():
        raise RequirementError(
            f"{where}: its id is {name!r}; it names files: use letters, digits, - and _, a letter first"
        )
    where = where.rpartition(",")[0] + f", {name}"
    methods = entry.get("verified_by")
    if not isinstance(methods, list) or not methods:
        raise RequirementError(f"{where}: verified_by must be a list of {', '.join(METHODS)}")
    for method in methods:
        if method not in METHODS:
            raise RequirementError(f"{where}: verified_by has {method!r}{choices_of(str(method), METHODS)}")
    texts: dict[str, Any] = {key: _text(entry, key, where) for key in TEXTS}
    severity = texts["severity"]
    if severity not in SEVERITIES:
        raise RequirementError(f"{where}: severity is {severity!r}{choices_of(severity, SEVERITIES)}")
    flown = _flown(entry, where) if set(methods) - {BOUNDS} else {}
    questions = _questions(entry.get("bounds"), where) if BOUNDS in methods else ()
    return Requirement(id=name, verified_by=tuple(methods), questions=questions, **texts, **flown)


def _flown(entry: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the fields of a requirement that are about flights."""
    text = _text(entry, "formula", where)
    try:
        formula = parse(text, units_for(text))
    except FormulaError as error:
        raise RequirementError(f"{where}, its formula:\n{error}") from error
    flown: dict[str, Any] = {"formula_text": text, "formula": formula}
    if {CASES, SPLITTING}.intersection(entry["verified_by"]):
        flown["confidence"] = _confidence(entry, where)
        is_catastrophic = entry["severity"] == SEVERITIES[0]
        if "probability" in entry or not is_catastrophic:
            flown["probability"] = _share(entry, "probability", where)
            flown["accepted"] = _text(entry, "accepted", where, ACCEPTANCE) if is_catastrophic else ""
    return flown


def _share(entry: Mapping[str, Any], key: str, where: str) -> float:
    """Return an entry's share; raise RequirementError unless it is between 0 and 1."""
    value = entry.get(key)
    if not isinstance(value, float) or not 0.0 < value < 1.0:
        raise RequirementError(f"{where}: {key} is {value!r}; it must be above 0 and below 1, such as 0.99")
    return value


def _confidence(entry: Mapping[str, Any], where: str) -> float:
    """Return an entry's confidence; raise RequirementError unless it is within `CONFIDENCES`."""
    value, (least, greatest) = entry.get("confidence"), CONFIDENCES
    if not isinstance(value, float) or not least <= value <= greatest:
        raise RequirementError(
            f"{where}: confidence is {value!r}; it must be from {least:g} to {greatest:g}, such as 0.9: "
            "with less a claim says little, and more takes more flights than can be flown"
        )
    return value


def _questions(entries: Any, where: str) -> tuple[Question, ...]:
    """Return the questions that a requirement asks about the systems' bounds."""
    questions = entries if isinstance(entries, list) else []
    are_questions = (
        isinstance(entry, dict) and {"ask"} <= set(entry) <= {"ask", "where"} for entry in questions
    )
    if not questions or not all(are_questions):
        raise RequirementError(
            f"{where}: bounds must be a list of questions to be answered with no, each "
            "{ask: conditions on outputs, where: conditions on inputs}"
        )
    return tuple(Question(str(entry["ask"]), str(entry.get("where", ""))) for entry in questions)


def _text(entry: Mapping[str, Any], key: str, where: str, cure: str = "give it a text") -> str:
    """Return a text of an entry; raise RequirementError if it is missing."""
    value = entry.get(key)
    if not isinstance(value, str) or not value.strip():
        raise RequirementError(f"{where}: {key} is missing; {cure}")
    return value.strip()


def check_formulas(requirements: Sequence[Requirement], mission: Mission) -> None:
    """Refuse formulas of which any part says nothing about a mission's flights.

    Raises
    ------
    RequirementError
    """
    if mission.chief.keep_out_m:
        raise RequirementError("chief.keep_out_m is given, which no requirement knows of; leave it out")
    check_deputies(requirements, mission)
    duration_s, period_s = mission.duration_s, mission.control_period_s
    for requirement in requirements:
        named = quantities_of(requirement.formula) if requirement.formula else ()
        counted = [name for name in ("inspection_rate", "inspectable_rate") if name in named]
        if counted and mission.chief.weights != "equal":
            raise RequirementError(
                f"{requirement.id}: {counted[0]} counts points, but with chief.weights="
                f"{mission.chief.weights} what counts is their weight; leave it out, and see the success of "
                "+experiment=evaluate"
            )
        if requirement.formula is None:
            continue
        flight = f"a flight of {duration_s:g} s with a sample every {period_s:g} s"
        if idle := idle_window(requirement.formula, duration_s, period_s):
            raise RequirementError(
                f"{requirement.id}: its part from {idle.first_s:g} to {idle.last_s:g} s says nothing about "
                f"{flight}; let each window hold one of its samples"
            )
        if late := late_window(requirement.formula, duration_s, period_s):
            raise RequirementError(
                f"{requirement.id}: its window from {late.first_s:g} to {late.last_s:g} s can end after "
                f"{flight}, and nothing is known beyond; end it, and each window around it, by the end of "
                "the flight, or leave the window out for the rest of the flight"
            )


def check_deputies(requirements: Sequence[Requirement], mission: Mission) -> None:
    """Refuse formulas of several deputies about one, and methods that know of one about a fleet.

    Raises
    ------
    RequirementError
    """
    for requirement in requirements:
        named = quantities_of(requirement.formula) if requirement.formula else ()
        of_fleets = [name for name in named if is_of_fleets(name)]
        unaware = [name for name in requirement.verified_by if name in OF_ONE_DEPUTY]
        if of_fleets and not mission.has_fleet:
            raise RequirementError(
                f"{requirement.id}: {of_fleets[0]} is of several deputies, and fleet.deputies is "
                f"{mission.fleet.deputies}; raise it, or leave the requirement out"
            )
        if unaware and mission.has_fleet:
            raise RequirementError(
                f"{requirement.id}: fleet.deputies is {mission.fleet.deputies}, and verified_by has "
                f"{unaware[0]}, which encloses the starts of one deputy; leave it out, or choose "
                "requirements for fleets, such as assurance.requirements=inspection_fleet"
            )


def check_starts(requirements: Sequence[Requirement], cases: MonteCarlo) -> None:
    """Refuse methods that enclose other starts than those of cases.

    Raises
    ------
    RequirementError
    """
    for requirement in requirements if cases.parked else ():
        if unaware := [name for name in requirement.verified_by if name in OF_ONE_DEPUTY]:
            raise RequirementError(
                f"{requirement.id}: monte_carlo.parked is true, and verified_by has {unaware[0]}, which "
                "knows no such starts; leave one of them out"
            )


def verified_by_method(requirements: Sequence[Requirement], method: str) -> tuple[Requirement, ...]:
    """Return the requirements that are verified by a method, possibly among others."""
    return tuple(requirement for requirement in requirements if method in requirement.verified_by)
