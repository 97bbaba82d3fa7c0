"""Colours: that all eyes and a grey print tell them apart, and that words on them can be read."""

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from fis_tools.render.theme import DARK, LIGHT, THEMES, Theme, contrast, readable_on, term_colours

Matrix = tuple[tuple[float, float, float], ...]

#: Machado, Oliveira and Fernandes 2009, severity 1, for linear red, green and blue
EYES: dict[str, Matrix] = {
    "all cones": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "no red cones": (
        (0.152286, 1.052583, -0.204868),
        (0.114503, 0.786281, 0.099216),
        (-0.003882, -0.048116, 1.051998),
    ),
    "no green cones": (
        (0.367322, 0.860646, -0.227968),
        (0.280085, 0.672501, 0.047413),
        (-0.011820, 0.042940, 0.968881),
    ),
    "no blue cones": (
        (1.255528, -0.076749, -0.178779),
        (-0.078411, 0.930809, 0.147602),
        (0.004733, 0.691367, 0.303900),
    ),
}


def lab(colour: object, eyes: Matrix = EYES["all cones"]) -> np.ndarray:
    """CIE 1976 L*a*b* under D65, as the eyes see it."""
    encoded = np.array(to_rgb(colour))  # type: ignore[arg-type]
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.array(eyes) @ linear, 0.0, 1.0)
    to_xyz = ((0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505))
    x, y, z = np.array(to_xyz) @ seen / (0.9505, 1.0, 1.089)
    fx, fy, fz = (np.cbrt(v) if v > 0.008856 else 7.787 * v + 16 / 116 for v in (x, y, z))
    return np.array([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)])


@pytest.mark.parametrize("eyes", EYES)
@pytest.mark.parametrize("theme", [LIGHT, DARK])
def test_lines_differ_for_all_eyes(theme: Theme, eyes: str) -> None:
    seen = [lab(colour, EYES[eyes]) for colour in theme.lines]
    distances = [np.linalg.norm(a - b) for place, a in enumerate(seen) for b in seen[:place]]
    assert min(distances) >= 25


@pytest.mark.parametrize("theme", [LIGHT, DARK])
def test_letters_in_a_themes_colours_can_be_read(theme: Theme) -> None:
    for colour in (*theme.lines, theme.ink, theme.muted):
        assert contrast(colour, theme.paper) >= 4.5
    assert contrast(theme.strong, theme.paper) >= 7


@pytest.mark.parametrize("count", range(2, 10))
def test_terms_become_brighter_in_steps_that_a_grey_print_keeps(count: int) -> None:
    lightness = [lab(tuple(colour))[0] for colour in term_colours(count)]
    assert min(b - a for a, b in pairwise(lightness)) >= 7


def test_words_on_a_terms_colour_can_be_read() -> None:
    for count in range(1, 12):
        for colour in term_colours(count):
            assert contrast(readable_on(colour), colour) >= 4.5


def test_contrast_is_that_of_the_guidelines() -> None:
    assert contrast("white", "black") == pytest.approx(21.0)
    # published examples: the darkest greys that pass AA and fail it on white
    assert contrast("#767676", "white") == pytest.approx(4.54, abs=0.005)
    assert contrast("#777777", "white") == pytest.approx(4.48, abs=0.005)


def test_firing_goes_from_the_paper_to_the_strongest_without_a_turn() -> None:
    for theme in THEMES.values():
        lightness = np.array([lab(theme.strength_map(x))[0] for x in np.linspace(0, 1, 33)])
        assert np.all(np.diff(lightness) * (1 if theme is DARK else -1) > 0)
