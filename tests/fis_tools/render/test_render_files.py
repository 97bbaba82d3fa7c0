"""Figures as files: whole, with text as text, and the same each time."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure

from fis_tools import render
from fis_tools.engines.inference import infer
from tests.fis_tools.render.picture_systems import room_system
from tests.fis_tools.sample_controllers import force_x_system

SVG = "{http://www.w3.org/2000/svg}"


def figures() -> dict[str, Figure]:
    system = force_x_system()
    drawn = dict(render.system_figures(system, theme=render.DARK))
    drawn |= dict(render.surface_figures(system, in_space=True))
    drawn["inference"] = render.inference_figure(infer(system, np.array([80.0, 0.05])))
    drawn["list"] = next(figure for _, figure in render.rules_figures(room_system()))
    return drawn


@pytest.mark.slow
def test_svg_is_well_formed_holds_its_words_as_text_and_is_identical_twice() -> None:
    words = {
        "memberships": "very near",
        "rules": "towards",
        "surface": "distance (m)",
        "surface-3d": "velocity_body_x (m/s)",
        "inference": "centre of area",
        "list": "heat is high",
    }
    again = figures()
    for name, figure in figures().items():
        content = render.encode(figure, "svg")
        root = ElementTree.fromstring(content)  # noqa: S314 - our own file
        texts = ["".join(node.itertext()) for node in root.iter(f"{SVG}text")]
        assert any(words[name] in text for text in texts), name
        assert render.encode(again[name], "svg") == content, name
        assert b"<dc:date>" not in content


@pytest.mark.slow
@pytest.mark.parametrize("form", ["png", "pdf"])
def test_pictures_of_pixels_and_pages_are_identical_twice(form: str) -> None:
    one, other = (
        render.encode(dict(render.rules_figures(force_x_system()))["rules"], form, 60) for _ in range(2)
    )
    assert one == other
    assert one.startswith({"png": b"\x89PNG", "pdf": b"%PDF"}[form])
    assert b"matplotlib" not in one.lower()


def test_the_ending_of_a_name_is_the_format(tmp_path: Path) -> None:
    figure, _ = render.one_panel("empty")
    render.save(figure, tmp_path / "a.PNG", 30)
    assert (tmp_path / "a.PNG").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="'docx' is not a picture format; choose one of png, svg, pdf"):
        render.save(figure, tmp_path / "a.docx")
