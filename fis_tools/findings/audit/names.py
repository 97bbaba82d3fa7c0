"""What the names of terms imply: that a term is lower or higher than another, or at zero."""

import re
from dataclasses import dataclass

#: Words of a magnitude, from little to much.
_MAGNITUDES = {
    "small": 1.0, "s": 1.0, "little": 1.0, "slight": 1.0, "slightly": 1.0,
    "medium": 2.0, "m": 2.0, "moderate": 2.0, "mid": 2.0,
    "large": 3.0, "l": 3.0, "big": 3.0, "b": 3.0, "great": 3.0, "strong": 3.0,
}  # fmt: skip
_SIGNS = {"negative": -1, "neg": -1, "n": -1, "minus": -1, "positive": 1, "pos": 1, "p": 1, "plus": 1}
_ZEROS = {"zero", "ze", "z", "zr", "zo", "null", "nil"}
#: Scales of words from low to high. A word in several is read by its neighbours.
_SCALES = (
    ("low", "medium", "high"),
    ("low", "middle", "high"),
    ("low", "moderate", "high"),
    ("small", "medium", "large"),
    ("small", "medium", "big"),
    ("little", "medium", "much"),
    ("few", "some", "many"),
    ("near", "middle", "far"),
    ("near", "medium", "far"),
    ("close", "medium", "far"),
    ("slow", "medium", "fast"),
    ("short", "medium", "long"),
    ("short", "medium", "tall"),
    ("cold", "cool", "mild", "warm", "hot"),
    ("cold", "comfortable", "hot"),
    ("weak", "medium", "strong"),
    ("light", "medium", "heavy"),
    ("poor", "average", "good", "excellent"),
    ("bad", "decent", "great"),
    ("poor", "mediocre", "amazing"),
    ("cheap", "average", "generous"),
    ("young", "middle", "old"),
    ("dry", "moist", "wet"),
    ("dark", "dim", "bright"),
    ("empty", "half", "full"),
)  # fmt: skip
_STRONGER = {"very", "extremely", "v"}
_WEAKER = {"rather", "fairly", "quite", "somewhat"}


@dataclass(frozen=True)
class Reading:
    """The rank of a term by its name, among terms whose names are read the same way.

    Parameters
    ----------
    rank : float
        Higher is higher.
    sign : int or None
        -1, 0 or 1 where the name says on which side of zero the term lies.
    """

    rank: float
    sign: int | None = None


def read(names: list[str]) -> list[Reading | None]:
    """Read the names of a variable's terms; None for a name that says nothing, or nothing to the others.

    Names such as ``negative_large``, ``NL``, ``zero``, ``PositiveSmall`` are read first. Without two of them
    that differ, the scale that knows most of the names counts, ``very`` and its like moving a word outwards.
    """
    signed = [_signed(_words(name)) for name in names]
    if len({reading.sign for reading in signed if reading is not None}) > 1:
        return signed
    by_scale = [[_on_scale(_words(name), scale) for name in names] for scale in _SCALES]
    best = max(by_scale, key=lambda readings: sum(reading is not None for reading in readings))
    zeros = [reading if reading is not None and reading.sign == 0 else None for reading in signed]
    if sum(reading is not None for reading in best) < 2:
        return list(zeros)
    return [zero or reading for zero, reading in zip(zeros, best, strict=True)]


def _words(name: str) -> list[str]:
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return [word.lower() for word in re.split(r"[\W_\d]+", parted) if word]


def _signed(words: list[str]) -> Reading | None:
    if len(words) == 1 and words[0] in _ZEROS:
        return Reading(0.0, 0)
    if len(words) == 1 and (match := re.fullmatch(r"([np])(v?)([smlb])", words[0])):
        words = [letter for letter in match.groups() if letter]
    signs = [_SIGNS[word] for word in words if word in _SIGNS]
    magnitudes = [_MAGNITUDES[word] for word in words if word in _MAGNITUDES]
    known = len(signs) + len(magnitudes) + sum(word in _STRONGER for word in words)
    if len(signs) != 1 or len(magnitudes) > 1 or known != len(words):
        return None
    magnitude = (magnitudes or [2.0])[0] + 0.5 * sum(word in _STRONGER for word in words)
    return Reading(signs[0] * magnitude, signs[0])


def _on_scale(words: list[str], scale: tuple[str, ...]) -> Reading | None:
    """Place a name on a scale from -1 to 1; ``very`` goes beyond its word, ``rather`` stays short."""
    outwards = 1.0 + 0.5 * sum(word in _STRONGER for word in words) - 0.25 * sum(w in _WEAKER for w in words)
    rest = [word for word in words if word not in _STRONGER | _WEAKER]
    if len(rest) != 1 or rest[0] not in scale:
        return None
    return Reading(outwards * (2.0 * scale.index(rest[0]) / (len(scale) - 1) - 1.0))
