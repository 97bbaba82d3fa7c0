"""Pictures of fuzzy systems: axes in, axes out, nothing saved; whole figures and files of them apart.

>>> from matplotlib import pyplot
>>> figure, ax = pyplot.subplots()
>>> ax = rule_matrix(system, ax, theme=DARK)  # doctest: +SKIP

What a colour says is also said by a word, a line style or a brightness, so that a grey print says the same.
"""

from importlib.util import find_spec

from fis_tools.errors import MissingExtra

if find_spec("matplotlib") is None:
    raise MissingExtra("drawing", "matplotlib", "matplotlib")

from matplotlib.figure import Figure

from fis_tools.render.figures import (
    encode,
    firing_figure,
    memberships_figure,
    one_panel,
    rules_figures,
    save,
    surface_figures,
    system_figures,
)
from fis_tools.render.inference import inference_figure, memberships
from fis_tools.render.rules import rule_matrix
from fis_tools.render.surfaces import draw_surface, held_words, over_axes, surface_map, surface_space
from fis_tools.render.theme import DARK, LIGHT, THEMES, Theme
