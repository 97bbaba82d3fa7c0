"""Colours of the page: they tell an order without hue, and words stand out from every ground."""

import re
from importlib.resources import files

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_hex

from fis_tools.render.theme import BRIGHTNESS_MAP, readable_on
from fis_tools.review.content import BRIGHTNESS, level, level_styles


def luminance(colour: str) -> float:
    """Relative luminance (WCAG 2.2)."""
    channels = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_the_colours_are_those_of_pictures():
    assert (
        tuple(map(to_hex, mpl.colormaps[BRIGHTNESS_MAP](np.linspace(0.0, 1.0, len(BRIGHTNESS)))))
        == BRIGHTNESS
    )


def test_brighter_is_greater():
    assert np.all(np.diff([luminance(colour) for colour in BRIGHTNESS]) > 0)
    for count in (1, 2, 5, 7):
        levels = [level(place, count) for place in range(count)]
        assert levels == sorted(set(levels))
        assert 0 <= levels[0] <= levels[-1] < len(BRIGHTNESS)
    steps = np.diff([luminance(BRIGHTNESS[level(place, 5)]) for place in range(5)])
    assert np.all(steps > 0.02)


def test_words_stand_out_from_every_level():
    pairs = re.findall(r"background: (#\w{6}); color: (#\w{6})", level_styles())
    assert [ground for ground, _ in pairs] == list(BRIGHTNESS)
    assert min(contrast(ground, ink) for ground, ink in pairs) >= 4.5
    for ground, ink in pairs:
        assert ink == to_hex(readable_on(ground))


@pytest.mark.parametrize("theme", [0, 1], ids=["light", "dark"])
def test_words_and_lines_stand_out_from_the_page(theme):
    style = (files("fis_tools.review") / "style.css").read_text(encoding="utf-8")
    found = re.findall(r"--([\w-]+): light-dark\((#\w{6}), (#\w{6})\)", style)
    colours = {name: pair[theme] for name, *pair in found}
    words = ("ink", "muted", "accent", "serious", "warning", *(f"term-{place}" for place in range(7)))
    for name in words:
        for ground in ("paper", "panel"):
            assert contrast(colours[name], colours[ground]) >= 4.5, (name, ground)
    assert contrast(colours["mark"], colours["paper"]) >= 3.0
