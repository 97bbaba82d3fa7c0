"""Commands about one evaluation, whose keys are those of ``+experiment=evaluate``, and ``warm``."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from fis_tools.compiled.notice import WARMING
from fis_tools.compiled.shipped.load import shipped_words
from pipeline.command_line import endings
from pipeline.command_line.arguments import EXPERIMENT, CommandParser, ConfigError, is_change, parse_arguments
from pipeline.command_line.config import compose_experiment
from pipeline.command_line.overrides import read_overrides, words_of
from pipeline.preflight import check_before
from pipeline.settings.checks import within
from pipeline.settings.experiment import Experiment

#: what short runs are given
FEW: Final = ("duration_s=600", "monte_carlo.num_cases=8")
SMALL: Final = ("optimizer.population_size=8", "optimizer.generations=2", "optimizer.rounds=1")
#: short runs, whose kinds of flight are those of the shipped experiments
WARMED: Final[Sequence[Sequence[str]]] = (
    ("+experiment=fly", "controller=champion_27"),
    ("+experiment=evaluate", "controller=champion_27", "stages=[scenario,evaluate]", *FEW),
    ("+experiment=train", "stages=[scenario,train]", *SMALL),
    ("+experiment=fly", "controller=lqr"),
    ("+experiment=fly", "controller=champion_leo", "world=leo"),
)


def parse_evaluation(parser: CommandParser, arguments: Sequence[str]) -> tuple[Any, Experiment]:
    """Parse a command about an evaluation: return its own options and the checked experiment of its keys.

    Raises
    ------
    ConfigError, SettingError
        For options, keys and values that cannot be used.
    """
    chosen, rest = parser.parse_known_args(list(arguments))
    for before, word in pairwise(["", *rest]):
        if not is_change(word) and {before, word.partition("=")[0]}.isdisjoint({"--config-dir", "-cd"}):
            raise ConfigError(f"{parser.prog} takes no {word}; it is about one evaluation, by key=value")
    command = parse_arguments(rest)
    overrides = read_overrides(command.overrides, command.folders, "give one")
    words = words_of(overrides)
    if EXPERIMENT not in {override.key_or_group for override in overrides}:
        words.insert(0, f"+{EXPERIMENT}=evaluate")
    experiment = compose_experiment(words, command.config_dir).experiment
    check_before(experiment)
    return chosen, experiment


def edit(arguments: Sequence[str]) -> int:
    """Open a page to edit rules and terms; each change flies the same 1,000 cases again.

    Usage: python -m pipeline edit [key=value ...] [--port PORT] [--no-browser]

    Keys are those of +experiment=evaluate, such as controller=champion_27, world=leo or sun=random. Ctrl-C
    ends it. Nothing is written but the copy that you save.

    Raises
    ------
    ValueError, OSError
        User errors.
    """
    parser = CommandParser("python -m pipeline edit")
    parser.add_argument("--port", type=int, default=0, metavar="PORT")
    parser.add_argument("--no-browser", action="store_true")
    chosen, experiment = parse_evaluation(parser, arguments)
    experiment.mission.require_one_deputy(parser.prog)
    within("--port", chosen.port, 0, 65535)
    from pipeline.edit.opening import open_editor  # noqa: PLC0415 - the other commands do without a server

    open_editor(experiment, chosen.port, opens_browser=not chosen.no_browser)
    return endings.OK


def export_c(arguments: Sequence[str]) -> int:
    """Write the whole on-board function of a controller as C99, with evidence and wrappers.

    Usage: python -m pipeline export_c controller=NAME [key=value ...] -o FOLDER [--flights N] [--bare]
    [--prefix NAME]

    Keys are those of +experiment=evaluate, such as controller=champion_27 or world=leo. The C is translated
    from the Python that flies. The commands of N recorded flights, 3 unless given, are compared bit by bit,
    and stand in the folder as a test vector. The folder must be new or empty. The exit code is 1 if a
    command differs. Of fleets each deputy flies the same function; what others are known to have seen is an
    input, and what they told where points are left to one another. A controller with foresight searches for
    its plan on board; with --bare it has its rules alone, and takes pushes that were planned on the ground as
    an input. With --prefix the names that other files see begin with NAME instead of controller, so that
    several controllers link into one program.

    Returns
    -------
    int
        The exit code; 1 if a command differs.

    Raises
    ------
    ValueError, OSError
        User errors.
    """
    parser = CommandParser("python -m pipeline export_c")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--flights", type=int, default=3, metavar="N")
    parser.add_argument("--bare", action="store_true")
    parser.add_argument("--prefix", default="controller", metavar="NAME")
    chosen, experiment = parse_evaluation(parser, arguments)
    within("--flights", chosen.flights, 1, 10000)
    folder: Path = chosen.output
    from pipeline.controllers.source import load  # noqa: PLC0415 - compiled code, needed once the rest is right
    from pipeline.onboard import allowed, dispersed, export, program  # noqa: PLC0415
    from pipeline.onboard.prefix import PrefixError, check_prefix  # noqa: PLC0415
    from pipeline.scenarios import evaluation_scenarios  # noqa: PLC0415

    mission = experiment.mission
    try:
        check_prefix(chosen.prefix)
        controller = load(experiment.controller, mission)
        translated = dispersed.of_all_flights(
            mission.of_each,
            lambda flown: program.translate(
                flown,
                controller,
                is_tilted=any(experiment.sun.elevations_deg),
                rules_alone=chosen.bare,
                fleet=mission.fleet,
            ),
        )
        exported = export.export(
            translated,
            evaluation_scenarios(experiment)[: chosen.flights],
            folder,
            chosen.prefix,
            mission.fleet,
        )
    except PrefixError as error:
        raise ConfigError(f"--prefix: {error}") from error
    except allowed.NotTranslatableError as error:
        raise ConfigError(str(error)) from error
    except OSError as error:
        raise ConfigError(
            f"{folder} cannot be filled ({error.strerror}); give a new folder, or make room"
        ) from error
    source = exported.source
    sys.stdout.write(
        f"{folder / 'controller.c'}: {source.code.count(chr(10))} lines, "
        f"{sum(source.tables.values())} bytes of tables, {source.state_bytes} of state\n"
    )
    if exported.num_different is None:
        sys.stdout.write("not compared with recorded flights, for gcc was not found\n")
        return endings.OK
    sys.stdout.write(
        f"{exported.num_different} of {exported.num_commands} commands of {exported.num_flights} recorded "
        "flights differ from those of this C\n"
    )
    return endings.OK if exported.num_different == 0 else endings.FAULT


def warm(given: Sequence[str]) -> int:
    """Compile what the shipped experiments need, so that later runs need not.

    Usage: python -m pipeline warm [--info]

    Some short runs are run in a folder of their own. `python -m pipeline warm &` does it in the background.
    With --info nothing is run: it tells which functions come with machine code for this processor, and
    whether that is of the source as it is here; all others are compiled when they are first needed.

    Raises
    ------
    ConfigError
        If anything is given.
    """
    parser = CommandParser("python -m pipeline warm")
    parser.add_argument("--info", action="store_true", help="tell what comes compiled, and run nothing")
    if parser.parse_args(given).info:
        sys.stdout.write("".join(f"{line}\n" for line in shipped_words()))
        return endings.OK
    with tempfile.TemporaryDirectory() as folder:
        for number, words in enumerate(WARMED):
            sys.stderr.write(f"[{number + 1}/{len(WARMED)}] {' '.join(words)}\n")
            command = [sys.executable, "-m", "pipeline", *words, f"hydra.run.dir={Path(folder, str(number))}"]
            warming = os.environ | {WARMING: "1"}
            done = subprocess.run(command, check=False, stdout=subprocess.DEVNULL, env=warming)  # noqa: S603
            if done.returncode:
                return done.returncode
    return endings.OK
