"""What Hydra composes of our own files, made once for each choice of groups: tests compose the same few.

A composition takes a sixth of a second, and a run makes two. Keys that a command sets are applied to a copy,
as Hydra applies them. Where a folder of somebody's own takes part, all is composed anew, for its files may
change.
"""

import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from hydra._internal import config_loader_impl
from hydra._internal.defaults_list import DefaultsList

from pipeline.settings.places import conf_folder

#: lists of defaults by sources, configuration and choices
_lists: dict[object, DefaultsList] = {}
#: configurations by the lists, which are kept, that they are made of; empty until one is made
_configurations: dict[int, bytes] = {}


def make_once() -> None:
    """Have Hydra make what it makes of our own files once."""
    module: Any = config_loader_impl
    loader = module.ConfigLoaderImpl
    module.create_defaults_list = _listed_once(module.create_defaults_list)
    loader._compose_config_from_defaults_list = _composed_once(loader._compose_config_from_defaults_list)


def _listed_once(create: Callable[..., DefaultsList]) -> Callable[..., DefaultsList]:
    ours = str(conf_folder())

    def listed(
        repo: Any, config_name: Any, overrides_list: Any, prepend_hydra: Any, skip_missing: Any
    ) -> DefaultsList:
        sources = tuple((each.scheme(), each.provider, each.path) for each in repo.get_sources())
        how = {"config_name": config_name, "prepend_hydra": prepend_hydra, "skip_missing": skip_missing}
        if any(scheme == "file" and path != ours for scheme, _, path in sources):
            return create(repo, overrides_list=overrides_list, **how)
        chosen, keys = [], []
        for each in overrides_list:
            if not each.is_sweep_override():
                is_choice = not isinstance(each.value(), dict) and repo.group_exists(each.key_or_group)
                (chosen if is_choice else keys).append(each)
        # a test may take a choice away
        is_there = [repo.config_exists(f"{each.key_or_group}/{each.value()}") for each in chosen]
        question = sources, *how.values(), *is_there, *(each.input_line for each in chosen)
        if question not in _lists:
            _lists[question] = create(repo, overrides_list=chosen, **how)
            _configurations[id(_lists[question].defaults)] = b""
        return replace(_lists[question], config_overrides=keys)

    return listed


def _composed_once(compose: Callable[..., Any]) -> Callable[..., Any]:
    def composed(loader: Any, defaults: Any, repo: Any) -> Any:
        kept = _configurations.get(id(defaults))
        if kept is None:
            return compose(loader, defaults, repo)
        if not kept:
            kept = _configurations[id(defaults)] = pickle.dumps(compose(loader, defaults, repo))
        return pickle.loads(kept)  # noqa: S301 - our own

    return composed
