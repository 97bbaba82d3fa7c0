"""Commands about one evaluation: options of their own, and keys as those of ``+experiment=evaluate``."""

import argparse
from collections.abc import Sequence

from pipeline.command_line import runs
from pipeline.command_line.arguments import EXPERIMENT, CommandParser, parse_arguments
from pipeline.command_line.config import compose_experiment
from pipeline.command_line.groups import options
from pipeline.command_line.overrides import read_overrides
from pipeline.settings.experiment import Experiment


def parse_evaluation(
    parser: CommandParser, arguments: Sequence[str]
) -> tuple[argparse.Namespace, Experiment]:
    """Parse a command about an evaluation: return its own options and the checked experiment of its keys.

    Raises
    ------
    ConfigError, SettingError
        For options, keys and values that cannot be used.
    """
    chosen, words = parser.parse_known_args(list(arguments))
    command = parse_arguments(words)
    overrides = read_overrides(command.overrides, options(command.folders), is_multirun=command.multirun)
    words = [override.input_line or "" for override in overrides]
    if EXPERIMENT not in {override.key_or_group for override in overrides}:
        words.insert(0, f"+{EXPERIMENT}=evaluate")
    experiment = compose_experiment(words, command.config_dir).experiment
    runs.check_before(experiment)
    return chosen, experiment
