"""Groups of settings: frozen dataclasses whose values pydantic checks."""

from collections.abc import Callable
from dataclasses import field
from functools import wraps
from typing import Any, TypeVar, dataclass_transform

from pydantic import ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass as checked_dataclass

from pipeline.settings import keys
from pipeline.settings.checks import SettingError
from pipeline.settings.conditions import Only
from pipeline.settings.sentences import names_of, sentence

Kind = TypeVar("Kind")

#: each class of settings with its group, "" for keys at the top, and what holds for all its keys
GROUPS: list[tuple[str, type[Any], tuple[Only, ...]]] = []


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field, Field))
def settings(group: str, *only: Only) -> Callable[[type[Kind]], type[Kind]]:
    """Make a class a frozen dataclass that checks its values, with the keys of a group in its errors.

    Parameters
    ----------
    group : str
        Such as ``optimizer.penalty``; empty for keys at the top of the configuration.
    *only : Only
        Where its keys exist, except for those that the conditions are about.

    Returns
    -------
    callable
        A decorator. The class that it returns raises a `SettingError` for unknown and missing keys and for
        values of the wrong type or beyond their limits.
    """

    def checked(plain: type[Kind]) -> type[Kind]:
        # built when first needed: most commands need few groups
        config = ConfigDict(extra="forbid", defer_build=True)
        made: Any = checked_dataclass(plain, config=config, frozen=True, kw_only=True)
        build = made.__init__

        @wraps(build)
        def check_and_build(self: Any, **values: Any) -> None:
            try:
                build(self, **values)
            except ValidationError as error:
                raise SettingError(sentence(made, group, error)) from error
            finally:
                # classes built when needed get pydantic's __init__ again
                made.__init__ = check_and_build

        made.__init__ = check_and_build
        keys.register(group, names_of(made))
        GROUPS.append((group, made, only))
        kind: type[Kind] = made
        return kind

    return checked
