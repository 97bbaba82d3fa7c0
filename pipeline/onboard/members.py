"""Members of the structure of C that hold what a flight carries on, by the declarations of its arrays."""

from collections.abc import Mapping
from typing import Any, get_args, get_type_hints

from pipeline.onboard.arrays import Record
from pipeline.onboard.translator import Translator


class Members:
    """The arrays of a flight's state or workspace as members of a structure of C, made when used.

    Their names begin with a prefix.
    """

    def __init__(
        self, translator: Translator, kind: Any, sizes: Mapping[str, int], prefix: str = "", **others: Any
    ) -> None:
        self._translator, self._sizes, self._prefix, self._others = translator, sizes, prefix, others
        self._declared = get_type_hints(kind, include_extras=True)

    def __getattr__(self, name: str) -> Any:
        """Return an array or a record."""
        if name.startswith("_") or name not in self._declared:
            raise AttributeError(name)
        if name in self._others:
            return self._others[name]
        array, *shape = get_args(self._declared[name])
        record = shape.pop() if isinstance(shape[-1], dict) else None
        lengths = tuple(self._sizes.get(length, length) for length in shape)
        if record is not None:
            return record_of(self._translator, "" if name == "lanes" else f"{name}_", record, lengths)
        return self._translator.member(
            self._prefix + name, lengths, "int" if "int64" in str(array) else "double"
        )


def record_of(
    translator: Translator, prefix: str, fields: Mapping[str, tuple[int, ...]], lengths: tuple[int, ...] = ()
) -> Record:
    """Return a record whose fields are members, with one lane."""

    def member(name: str, indices: tuple[Any, ...]) -> Any:
        is_whole = name == "cut_terms"
        shape = (*lengths, *fields[name], *(() if is_whole else (1,)))
        array = translator.member(prefix + name, shape, "int" if is_whole else "double")
        return array.at(indices) if indices else array

    return Record(member, tuple(fields))
