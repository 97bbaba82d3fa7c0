"""Groups of settings: frozen dataclasses whose values pydantic checks, and whose errors are sentences.

A key whose number has no effect is no key: it is not in a run's configuration, and giving it is a mistake.
``Only("navigation.mode=fixes")`` among the annotations of a key, or given to the class for all keys of its
group, says so once, for the check, the help and the reference page.
"""

from collections.abc import Mapping
from dataclasses import field
from typing import Any, ClassVar, dataclass_transform

from pydantic import ConfigDict, Field, GetCoreSchemaHandler, ValidationError
from pydantic._internal._docs_extraction import extract_docstrings_from_cls
from pydantic.dataclasses import dataclass as checked_dataclass
from pydantic_core import CoreSchema, core_schema

from pipeline.settings.checks import SettingError
from pipeline.settings.conditions import Only
from pipeline.settings.keys import FREE, KNOWN, dotted
from pipeline.settings.refusals import no_group, sentence
from pipeline.settings.variants import names_of, variant_of

#: each class of settings with its group, "" for keys at the top, and what holds for all its keys
GROUPS: list[tuple[str, type[Any], Only | None]] = []

#: of classes of settings: built when first needed, as most commands need few groups
CONFIG = ConfigDict(extra="forbid", defer_build=True)


class SettingsType(type):
    """The type of classes of settings, whose calls check values and refuse them in sentences."""

    def __call__(cls, *args: Any, **values: Any) -> Any:
        """Return an instance; of a class with variants, of the variant that the values' tags name.

        Raises
        ------
        SettingError
            For unknown and missing keys, and for values of the wrong type or beyond their limits.
        """
        kind: Any = variant_of(cls, values) if cls.__subclasses__() else cls
        try:
            return type.__call__(kind, *args, **values)
        except ValidationError as error:
            raise SettingError(sentence(kind, error)) from error


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field, Field))
class Settings(metaclass=SettingsType):
    """A group of settings: its subclasses are frozen dataclasses whose values pydantic checks.

    A group whose keys depend on a tag, such as ``navigation.mode``, is a class with variants: subclasses that
    narrow the tag to one value. Calling the class returns the variant that the values name.
    """

    #: of its keys, and the class that the group is entered with
    group: ClassVar[str] = ""
    root: ClassVar[type[Any] | None] = None

    def __init_subclass__(cls, *, group: str | None = None, only: Only | None = None) -> None:
        """Make a subclass a dataclass, and enter its keys among those that are known.

        Parameters
        ----------
        group : str, optional
            Such as ``optimizer.penalty``; empty for keys at the top of the configuration. A class without one
            is a variant, or holds what others share.
        only : Only, optional
            Where its keys exist, except for those that the condition is about.
        """
        checked_dataclass(cls, config=CONFIG, frozen=True, kw_only=True)
        if group is not None:
            cls.group, cls.root = group, cls
            GROUPS.append((group, cls, only))
        if cls.root is not None and cls.group != FREE:
            KNOWN.update(dotted(cls.group, (name,)) for name in names_of(cls))

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Let a class with variants choose, where it is the type of a field."""
        if not cls.__subclasses__():
            return handler(source)

        def built(value: Any) -> Any:
            if isinstance(value, cls):
                return value
            if isinstance(value, Mapping):
                return cls(**{str(name): inside for name, inside in value.items()})
            raise ValueError(no_group("{key}", value, cls))

        return core_schema.no_info_plain_validator_function(built)


def texts_of(kind: Any) -> dict[str, str]:
    """Return the texts that describe the fields of a class of settings: those below them, or given.

    pydantic's ``use_attribute_docstrings`` finds the same, but while classes are made, which every command
    would wait for: a millisecond a class.
    """
    texts: dict[str, str] = {}
    for owner in reversed(kind.__mro__[:-1]):
        given = getattr(owner, "__pydantic_fields__", {}).items()
        texts |= extract_docstrings_from_cls(owner, use_inspect=True)
        texts |= {name: entry.description for name, entry in given if entry.description}
    return {name: " ".join(text.split()) for name, text in texts.items()}
