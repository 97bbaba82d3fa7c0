"""Groups of options in folders of configurations: what may be chosen, without composing anything."""

import re
from collections.abc import Sequence
from pathlib import Path

HYDRA = "hydra"
#: folders of the configuration that are not groups of options: Hydra's own, and requirements, read by name
NOT_CHOSEN = (HYDRA, "requirements")


def options(folders: Sequence[Path]) -> dict[str, list[str]]:
    """Return the groups of some configuration folders and the options of each, without `NOT_CHOSEN`.

    Returns
    -------
    dict of str to list of str
        Group, such as ``controller`` or ``controller/champions``, to the sorted names of its options; a file
        in a group's subfolder is also an option ``subfolder/name`` of the group.
    """
    groups: dict[str, set[str]] = {}
    for folder in folders:
        for path in folder.rglob("*.yaml"):
            parts = path.relative_to(folder).with_suffix("").parts
            # files whose names begin with _ hold what several options share
            if not path.stem.startswith("_") and parts[0] not in NOT_CHOSEN:
                for cut in range(1, len(parts)):
                    groups.setdefault("/".join(parts[:cut]), set()).add("/".join(parts[cut:]))
    return {group: sorted(names) for group, names in sorted(groups.items())}


def top_of(key: str) -> str:
    """Return the first name of a key or group."""
    return re.split("[./]", key, maxsplit=1)[0]
