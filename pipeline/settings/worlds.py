"""Worlds: their differences from the experiment's own, by groups of the configuration."""

from collections.abc import Mapping
from dataclasses import asdict, replace

from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Experiment, Mission, Sun
from pipeline.settings.keys import unknown
from pipeline.settings.nearest import did_you_mean
from pipeline.settings.schema import idle


def in_world(experiment: Experiment, name: str) -> Experiment:
    """Return an experiment in one of the worlds of ``compare.worlds``; "" is its own.

    Raises
    ------
    SettingError
        If the world changes keys that are not part of a world, or sets a value that is not allowed.
    """
    changes = experiment.compare.worlds.get(name, {})
    mission, sun = asdict(experiment.mission), asdict(experiment.sun)
    for group, values in changes.items():
        if group != "sun" and group not in mission:
            guess = did_you_mean(group, ["sun", *mission])
            raise SettingError(f"compare.worlds.{name} changes {group}, which is no part of a world{guess}")
        target = sun if group == "sun" else mission[group]
        if not isinstance(target, dict):
            mission[group] = values
        elif not isinstance(values, Mapping):
            raise SettingError(
                f"compare.worlds.{name}.{group} is {values}; give its keys, as in {group}: {{...}}"
            )
        else:
            for key in values:
                if key not in target:
                    raise SettingError(f"compare.worlds.{name}: {unknown(f'{group}.{key}')}")
            target.update(values)
    there = {**mission, "sun": sun}
    for key, mark in idle(there).items():
        group, _, last = key.rpartition(".")
        # the Sun's mode is that of compare.suns
        if group != "sun" and last in changes.get(group, {}):
            raise SettingError(f"compare.worlds.{name}: {mark.refusal(key, there)}")
    return replace(experiment, mission=Mission(**mission), sun=Sun(**sun))
