"""From plain mappings to settings: the mission's groups are at the top of a configuration."""

from collections.abc import Mapping
from typing import Any

from pipeline.settings.experiment import Experiment, Mission, SettingError
from pipeline.settings.keys import in_todays_words, unknown
from pipeline.settings.sentences import names_of


def experiment_from(config: Mapping[str, Any]) -> Experiment:
    """Build an experiment from a resolved configuration of plain data.

    Raises
    ------
    SettingError
        If a key is unknown or missing, or a value has the wrong type or is not allowed; keys of earlier
        versions are read if today's are missing.
    """
    config = in_todays_words(config)
    own, of_mission = names_of(Experiment), names_of(Mission)
    for name in config:
        if name not in own and name not in of_mission:
            raise SettingError(unknown(name))
    mission = Mission(**{name: config[name] for name in of_mission if name in config})
    return Experiment(mission=mission, **{name: config[name] for name in own if name in config})
