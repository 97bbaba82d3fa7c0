"""Colours whose brightness tells an order, so that it survives grey scale and colour blindness."""

from collections.abc import Sequence

#: cividis (J. R. Nuñez, C. R. Anderton, R. S. Renslow, PLoS ONE 13, 2018) from its lowest to its highest
BRIGHTNESS = (
    *("#00224e", "#00285b", "#002e6a", "#053371", "#1a386f", "#273e6e", "#32436d", "#3b496c", "#434e6c"),
    *("#4b546c", "#535a6d", "#5a5f6e", "#61656f", "#686a71", "#6f7073", "#767676", "#7d7c78", "#848279"),
    *("#8c8878", "#938e78", "#9b9476", "#a39a74", "#aba072", "#b4a76f", "#bcae6c", "#c4b468", "#cdbb63"),
    *("#d5c25e", "#dec958", "#e7d150", "#f0d846", "#f9e03a", "#fee838"),
)


def level(place: int, count: int) -> int:
    """Return which of the levels of `BRIGHTNESS` the thing at a place among some ordered things has."""
    last = len(BRIGHTNESS) - 1
    return round((0.08 + 0.9 * (place / (count - 1) if count > 1 else 0.7)) * last)


def level_styles() -> str:
    """Return the rules of a style sheet that give each level its ground and a readable ink."""
    rules = [
        f".level-{place} {{ background: {colour}; color: {_ink(colour)}; }}"
        for place, colour in enumerate(BRIGHTNESS)
    ]
    return "\n".join(rules) + "\n"


def _ink(colour: str) -> str:
    """Return the one of black and white that stands out more (relative luminance of WCAG 2.2)."""
    channels = [int(colour[place : place + 2], 16) / 255.0 for place in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    luminance = _weighted(linear, (0.2126, 0.7152, 0.0722))
    return "#ffffff" if 1.05 / (luminance + 0.05) > (luminance + 0.05) / 0.05 else "#000000"


def _weighted(values: Sequence[float], weights: Sequence[float]) -> float:
    return sum(value * weight for value, weight in zip(values, weights, strict=True))
