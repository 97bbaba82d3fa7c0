"""The resolved configuration that a run keeps: plain data as YAML, and the hash of what results depend on."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import yaml

from pipeline.run.artifacts import CONFIG, ArtifactError, explained, require
from pipeline.run.writing import write_atomically
from pipeline.settings.schema import only_results
from plain_files import plain_yaml
from plain_files.file_access import read_bytes
from plain_files.plain_text import plain

#: of a configuration that is read
MOST_CONFIG_BYTES: Final = 2 * 1024 * 1024


def config_hash(config: Mapping[str, Any]) -> str:
    """Return a hash of the part of a resolved configuration that results depend on.

    Parameters
    ----------
    config : mapping
        Plain data. Settings that no result depends on do not count, nor does its part ``hydra``, which only
        sets output folders.

    Returns
    -------
    str
        SHA-256 of ``json.dumps(config, sort_keys=True)``, 64 hexadecimal digits.
    """
    return _hash_of(only_results(config))


def _hash_of(config: Mapping[str, Any]) -> str:
    counted = {key: value for key, value in config.items() if key != "hydra"}
    return hashlib.sha256(json.dumps(counted, sort_keys=True).encode()).hexdigest()


def is_of(config: Mapping[str, Any], manifest: Mapping[str, Any]) -> bool:
    """Return whether a manifest is of a run with this configuration; earlier versions hashed all keys."""
    return manifest["config_hash"] in (config_hash(config), _hash_of(config))


def text(config: Mapping[str, Any]) -> str:
    """Return a resolved configuration as YAML that reads back to the same data."""
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # the first is ten times as fast
    return yaml.dump(
        dict(config), Dumper=dumper, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
    )


def parse(content: bytes) -> Any:
    """Parse the output of `text` into plain data.

    Raises
    ------
    ValueError
        If it is larger, deeper or of another kind than `text` writes.
    """
    return plain(plain_yaml.parse(content, MOST_CONFIG_BYTES))


def write(folder: Path, config: Mapping[str, Any]) -> None:
    """Write a resolved configuration into a run's folder, see `text`."""
    write_atomically(folder / CONFIG, text(config))


def read(folder: Path) -> dict[str, Any]:
    """Read the configuration of a run as it is stored.

    Raises
    ------
    ArtifactError
        If the folder contains no run, or its configuration cannot be read.
    """
    if not folder.is_dir():
        raise ArtifactError(f"{folder} is no folder; give the folder of a run, outputs/NAME/TIME")
    path = require(folder, CONFIG)
    with explained(f"{path} cannot be read", "restore it, or start a new run"):
        config = parse(read_bytes(path))
    if not isinstance(config, dict):
        raise ArtifactError(f"{path} holds no configuration; it must be a mapping of keys to values")
    return config
