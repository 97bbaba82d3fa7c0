"""Design, fly and review fuzzy controllers that inspect a spacecraft.

usage: python -m pipeline +experiment=NAME [controller=NAME_OR_PATH] [key=value ...]

  python -m pipeline +experiment=fly controller=paper_champion     fly once and record it
  python -m pipeline +experiment=evaluate sun=random               1,000 flights from random starts
  python -m pipeline +experiment=train                             train, evaluate and report
  python -m pipeline +experiment=assure controller=paper_champion  evidence for requirements
  python -m pipeline -m +experiment=train seed=1,2,3               a sweep
  python -m pipeline summary FOLDER                                the results of a sweep, or of other runs
  python -m pipeline compare=RUN_A,RUN_B                           two runs on the cases that they share
  python -m pipeline resume=RUN_FOLDER                             go on where a run, or a sweep, stopped
  python -m pipeline verify RUN_FOLDER                             check its files, repeat its flights
  python -m pipeline edit controller=champion_27                   edit it, 1,000 flights a touch
  python -m pipeline warm                                          compile what the experiments need
  python -m pipeline stages=[report] hydra.run.dir=RUN_FOLDER      repeat a stage on a run's files
  python -m telemetry replay FILE.mcap                             watch a recorded flight
  python -m fis_tools show CONTROLLER                              read a controller

options: --help, --help EXPERIMENT (what people change in it), --help GROUP (its keys), --version, -m (sweep),
         --help controller (which champion to take), --config-dir DIR (your experiments and controllers),
         --cfg job (print the configuration, each key with its meaning, and stop)
"""

from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from fis_tools.document.text import aligned
from fis_tools.file_access import read_text
from pipeline.command_line.arguments import ConfigError
from pipeline.command_line.choosing import recommendations
from pipeline.command_line.config import compose_node, without_hydra
from pipeline.command_line.groups import options
from pipeline.settings import schema
from pipeline.settings.keys import unknown, value_at
from pipeline.settings.places import conf_folder

#: what people change, groups and keys, in this order
OFTEN = (
    "controller",
    "problem",
    "world",
    "sun",
    "seed",
    "monte_carlo.num_cases",
    "optimizer.population_size",
    "optimizer.generations",
    "starts",
    "assurance.num_cases",
    "assurance.searches",
    "deputy.initial_position_m",
    "safety",
    "duration_s",
    "deputy.mass_kg",
    "guidance",
)
MOST_OFTEN = 10
INDENT = 6 * " "
#: how the purpose of a controller begins that is not flown for results
TEMPLATE = "A start for searches"


def help_text(folders: Sequence[Path]) -> str:
    """Return the help.

    Parameters
    ----------
    folders : sequence of Path
        Configuration folders, ours and the user's.

    Returns
    -------
    str
        Plain text of many lines.
    """
    from pipeline.flight.state.signals import CONSTANTS, SIGNALS, TOUR_COEFFICIENTS  # noqa: PLC0415 - help alone

    groups = options(folders)
    signals = [
        (name, f"[{signal.unit}] {signal.description}{signal.formula and f': {signal.formula}'}")
        for name, signal in SIGNALS.items()
    ]
    constants = [
        (name, kind.description) for name, kind in CONSTANTS.items() if name not in TOUR_COEFFICIENTS
    ]
    controllers, templates = _described(folders, "controller", groups), _templates(folders, groups)
    shown = ("experiment", "controller")
    others = [(name, ", ".join(groups[name])) for name in groups if name not in shown and "/" not in name]
    return "\n".join(
        [
            __doc__ or "",
            "experiments (+experiment=NAME)",
            *_table(_described(folders, "experiment", groups)),
            "\ncontrollers (controller=NAME, or the path of a .json or .yaml file)",
            *_table([row for row in controllers if row[0] not in templates]),
            "\ncontrollers from which searches start, and which nobody flies for results (controller=NAME)",
            *_table([row for row in controllers if row[0] in templates]),
            "\nsignals that an input of a fuzzy system may sense, with their units",
            *_table(signals),
            "\nconstants that a controller may set as attributes; 0 switches what they do off",
            *_table(
                [*constants, ("tour_*_m", "mean and waves of the tour along each axis, and of its lift, m")]
            ),
            "\nother choices (GROUP=NAME)",
            *_table(others),
            "\ngroups of keys (--help GROUP lists them; --cfg job prints all values)",
            *_table([(name, schema.descriptions()[name]) for name in schema.tables() if name]),
        ]
    )


def help_on(topics: Sequence[str], folders: Sequence[Path]) -> str:
    """Return the help on some experiments, groups and keys.

    Raises
    ------
    ConfigError
        If there is no such key.
    """
    experiments = dict(_described(folders, "experiment", options(folders)))
    texts = []
    for topic in topics:
        text = _experiment(topic, experiments[topic]) if topic in experiments else schema.help_on(topic)
        if topic == "controller":
            text = f"{recommendations()}\n\n{text}".rstrip()
        if not text:
            raise ConfigError(unknown(topic))
        texts.append(f"{text}\n")
    return "".join(texts)


def _experiment(name: str, about: str) -> str:
    """Return the help on an experiment: its purpose, and the keys that people change, with their values."""
    config: Any = OmegaConf.to_container(without_hydra(compose_node([f"+experiment={name}"])))
    unread = schema.idle(config, stages=True)
    groups = options([conf_folder()])
    lines = [f"+experiment={name}: {about}", f"  stages={schema.as_yaml(value_at(config, 'stages'))}"]
    for key in [key for key in OFTEN if key in groups or key not in unread][:MOST_OFTEN]:
        if key in groups:
            names = [option for option in groups[key] if "/" not in option]
            if key == "controller" and "train" not in value_at(config, "stages"):
                names = [name for name in names if name not in _templates([conf_folder()], groups)]
            lines += [f"  {key}=NAME", f"{INDENT}One of {', '.join(names)}."]
        else:
            value = schema.as_yaml(value_at(config, key))
            lines += [f"  {key}={value}", f"{INDENT}{schema.descriptions()[key]}"]
    return "\n".join([*lines, "--cfg job prints all keys, --help GROUP those of a group."])


def _templates(folders: Sequence[Path], groups: dict[str, list[str]]) -> set[str]:
    """Return the names of controllers from which searches start."""
    names = set()
    for name in groups["controller"]:
        files = [path for folder in folders if (path := folder / "controller" / f"{name}.yaml").is_file()]
        if files and f'purpose: "{TEMPLATE}' in read_text(files[-1]):
            names.add(name)
    return names


def _described(folders: Sequence[Path], group: str, groups: dict[str, list[str]]) -> list[tuple[str, str]]:
    """Return each option of a group with the first sentence of its file."""
    rows = []
    for name in groups.get(group, []):
        files = [path for folder in folders if (path := folder / group / f"{name}.yaml").is_file()]
        rows.append((name, _first_comment(files[-1]) if files else ""))
    return rows


def _first_comment(path: Path) -> str:
    """Return the first comment line at the top of a YAML file that is not a Hydra directive."""
    comments = takewhile(lambda line: line.startswith("#"), read_text(path).splitlines())
    texts = (line.lstrip("#").strip() for line in comments)
    return next((text for text in texts if text and not text.startswith("@package")), "")


def _table(rows: Sequence[tuple[str, str]]) -> list[str]:
    return [f"  {line}".rstrip() for line in aligned(rows)]
