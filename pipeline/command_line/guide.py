"""Design, fly and review fuzzy controllers that inspect a spacecraft.

usage: python -m pipeline +experiment=NAME [controller=NAME_OR_PATH] [key=value ...]

  python -m pipeline +experiment=fly controller=paper_champion     fly once and record it
  python -m pipeline +experiment=evaluate sun=random               1,000 flights from random starts
  python -m pipeline +experiment=train                             train, evaluate and report
  python -m pipeline +experiment=assure controller=paper_champion  evidence for requirements
  python -m pipeline -m +experiment=train seed=1,2,3               a sweep
  python -m pipeline summary FOLDER                                the results of a sweep, or of other runs
  python -m pipeline compare=RUN_A,RUN_B page=FILE.html            two runs on the cases that they share
  python -m pipeline merge RUN_A RUN_B                             one run of the shards of a campaign
  python -m pipeline resume=RUN_FOLDER                             go on where a run, or a sweep, stopped
  python -m pipeline verify RUN_FOLDER                             check its files, repeat its flights
  python -m pipeline fly RUN_FOLDER case=7                         fly a case of it again, recorded
  python -m pipeline edit controller=champion_27                   edit it; each change flies 1,000 cases
  python -m pipeline warm                                          compile what the experiments need
  python -m pipeline again RUN_FOLDER                              the same run again, in a new folder
  python -m pipeline repeat RUN_FOLDER report                      repeat stages on a run's files
  python -m telemetry replay FILE.mcap                             watch a recorded flight
  python -m fis_tools show CONTROLLER                              read a controller

options: --help, --help EXPERIMENT (what people change in it), --help GROUP (its keys), --version, -m (sweep),
         --help controller (which champion to take), --config-dir DIR (your experiments and controllers),
         --cfg job (print the configuration, each key with its meaning, and stop)
"""

import csv
import shutil
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path
from re import fullmatch
from textwrap import TextWrapper

from pipeline.command_line.arguments import ConfigError
from pipeline.command_line.choices import options
from pipeline.settings import schema
from pipeline.settings.keys import unknown, value_at
from plain_files.file_access import read_shipped, read_text

#: what people change, groups and keys, in this order
OFTEN = (
    *("controller", "problem", "world", "sun", "seed", "monte_carlo.num_cases", "optimizer.population_size"),
    *("optimizer.generations", "starts", "assurance.num_cases", "assurance.searches"),
    *("deputy.initial_position_m", "safety", "duration_s", "deputy.mass_kg", "guidance"),
)
MOST_OFTEN = 10
#: columns for what a name means, at least
LEAST_ROOM = 30
INDENT = 6 * " "
#: how the purpose of a controller begins in its file if it is not flown for results
TEMPLATE = 'purpose: "A start for searches'

#: what is no rule where one signs rules
LOW_ORBIT = (
    "In champion_leo the 15 rules say how much of the push onto the tour to make. The tour itself is 20\n"
    "constants (tour_*_m); simulated flights choose which of its images to follow (rehearsal_tours)."
)


def help_on(words: Sequence[str], folders: Sequence[Path]) -> str:
    """Return the help on the experiments, groups and keys among some words; without any the whole help.

    Parameters
    ----------
    words : sequence of str
    folders : sequence of Path
        Configuration folders, ours and the user's.

    Raises
    ------
    ConfigError
        If there is no such key.
    """
    topics = [match[1] for word in words if (match := fullmatch(r"(?:\+experiment=)?([\w.]+)", word))]
    experiments = {name: _first_comment(path) for name, path in _files(folders, "experiment").items()}
    texts = [] if topics else [_help_text(folders, experiments)]
    for topic in topics:
        text = _experiment(topic, experiments, folders) if topic in experiments else schema.help_on(topic)
        if topic == "controller":
            text = f"{recommendations()}\n\n{text}".rstrip()
        if not text:
            raise ConfigError(unknown(topic))
        texts.append(f"{text}\n")
    return "".join(texts)


def _help_text(folders: Sequence[Path], experiments: dict[str, str]) -> str:
    from pipeline.flight.state.signals import CONSTANTS, SIGNALS, TOUR_COEFFICIENTS  # noqa: PLC0415 - help alone

    controllers = {name: _first_comment(path) for name, path in _files(folders, "controller").items()}
    templates = {name: controllers.pop(name) for name in _templates(folders)}
    constants = {name: kind.description for name, kind in CONSTANTS.items() if name not in TOUR_COEFFICIENTS}
    constants["tour_*_m"] = "mean and waves of the tour along each axis, and of its lift, m"
    tables = {
        "experiments (+experiment=NAME)": experiments,
        "controllers (controller=NAME, or the path of a .json or .yaml file)": controllers,
        "controllers from which searches start, not flown for results (controller=NAME)": templates,
        "signals that an input of a fuzzy system may sense, with their units": {
            name: f"[{signal.unit}] {signal.description}{signal.formula and f': {signal.formula}'}"
            for name, signal in SIGNALS.items()
        },
        "constants that a controller may set as attributes; 0 switches what they do off": constants,
        "other choices (GROUP=NAME)": {
            name: ", ".join(names)
            for name, names in options(folders).items()
            if name not in ("experiment", "controller") and "/" not in name
        },
        "groups of keys (--help GROUP lists them; --cfg job prints all values)": {
            name: schema.descriptions()[name] for name in schema.tables() if name
        },
    }
    lines = [__doc__ or ""]
    for title, rows in tables.items():
        lines += [title, *_listing(rows), ""]
    return "\n".join(lines)


def _listing(rows: dict[str, str]) -> list[str]:
    """Return names with what they mean; where a terminal says how wide it is, in lines that fit."""
    width = max(map(len, rows))
    columns = max(width + 4 + LEAST_ROOM, shutil.get_terminal_size((10_000, 24)).columns)
    beneath = " " * (width + 4)
    wrapper = TextWrapper(columns, "", beneath, break_long_words=False, break_on_hyphens=False)
    return [wrapper.fill(f"  {name:<{width}}  {words}") for name, words in rows.items()]


def _experiment(name: str, experiments: dict[str, str], folders: Sequence[Path]) -> str:
    """Return the help on an experiment: its purpose, and the keys that people change, with their values."""
    from pipeline.command_line.config import compose_node, plain  # noqa: PLC0415 - Hydra

    config, groups = plain(compose_node([f"+experiment={name}"], folders), resolve=False), options(folders)
    unread, stages = schema.idle(config, stages=True), value_at(config, "stages")
    lines = [f"+experiment={name}: {experiments[name]}", f"  stages={schema.as_yaml(stages)}"]
    hidden = () if "train" in stages else _templates(folders)
    for key in [key for key in OFTEN if key in groups or key not in unread][:MOST_OFTEN]:
        if key in groups:
            names = [option for option in groups[key] if "/" not in option and option not in hidden]
            lines += [f"  {key}=NAME", f"{INDENT}One of {', '.join(names)}."]
        else:
            value = schema.as_yaml(value_at(config, key))
            lines += [f"  {key}={value}", f"{INDENT}{schema.descriptions()[key]}"]
    return "\n".join([*lines, "--cfg job prints all keys, --help GROUP those of a group."])


def _files(folders: Sequence[Path], group: str) -> dict[str, Path]:
    """Return the file of each option of a group."""
    paths = {path.stem: path for folder in folders for path in folder.glob(f"{group}/[!_]*.yaml")}
    return dict(sorted(paths.items()))


def _templates(folders: Sequence[Path]) -> list[str]:
    """Return the names of controllers from which searches start."""
    return [name for name, path in _files(folders, "controller").items() if TEMPLATE in read_text(path)]


def _first_comment(path: Path) -> str:
    """Return the first comment line at the top of a YAML file that is not a Hydra directive."""
    comments = takewhile(lambda line: line.startswith("#"), read_text(path).splitlines())
    texts = (line.lstrip("#").strip() for line in comments)
    return next((text for text in texts if text and not text.startswith("@package")), "")


def table() -> list[list[str]]:
    """Return headings and a row for each champion: what was measured, and the page under docs that has it."""
    return list(csv.reader(read_shipped(Path(__file__).with_name("choosing.csv")).splitlines()))


def recommendations() -> str:
    """Return the recommendations as text, and which parts of the low-orbit controllers are no rules."""
    lines = ["which champion to take"]
    for name, rules, world, sun, delta_v, success, outside, layer, purpose, _ in table()[1:]:
        measured = [f"{delta_v} m/s, success {success}, {outside} outside"] if delta_v else []
        measured += [f"with safety=filter or robust: {layer}"] if layer else []
        lines.append(f"  controller={name} world={world} ({rules} rules, Sun {sun}): {purpose}")
        lines.append(f"      {'; '.join(measured)}")
    return "\n".join([*lines, LOW_ORBIT])
