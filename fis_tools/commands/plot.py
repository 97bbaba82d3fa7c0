"""`plot`: every picture of a controller, into a folder."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

from cyclopts import Parameter

from fis_tools.analysis import flights
from fis_tools.array_types import Floats
from fis_tools.commands.arguments import UserMistake, file_name, place_for
from fis_tools.commands.instant import AskedInstant, instants
from fis_tools.engines.inference import infer

if TYPE_CHECKING:
    from fis_tools.model import FuzzyController, FuzzySystem
    from fis_tools.render import Figure, Theme

    Pictures: TypeAlias = Iterator[tuple[FuzzySystem, str, Figure]]

KINDS = ("memberships", "rules", "surfaces", "inference", "firing")


def run(
    asked: AskedInstant,
    *,
    output: Annotated[str, Parameter(name=("--output", "-o"))] = ".",
    format: Literal["png", "svg", "pdf"] = "png",
    theme: Literal["light", "dark"] = "light",
    only: tuple[Literal["memberships", "rules", "surfaces", "inference", "firing"], ...] = (),
) -> None:
    """Draw membership functions, rules, surfaces and inferences into a folder.

    Names of files begin with that of the system: force_x-memberships.png, force_x-rules.png,
    force_x-surface.png, force_x-surface-3d.png (force_x-curve.png for a single input), …

    For example:

        python -m fis_tools plot controller.yaml -o figures
        python -m fis_tools plot controller.yaml --system force_x --only rules --theme dark --format svg
        python -m fis_tools plot controller.yaml --only inference --inputs distance=80,velocity_body_x=0.05
        python -m fis_tools plot episodes/best.mcap --time 600 -o figures
        python -m fis_tools plot fan.yaml --data room.csv --only firing

    Parameters
    ----------
    output
        folder for the pictures
    format
        of the files
    theme
        of the pictures
    only
        draw only this; may be given several times [default: all; an inference when --inputs or --time say
        which; firing with flights]
    """
    from fis_tools.render import THEMES, save  # noqa: PLC0415 - the other commands start without matplotlib

    colours, kinds = THEMES[theme], _kinds(asked, only)
    controller = asked.read()
    inferences = _fired(asked, controller) if "inference" in kinds else []
    taken: Counter[str] = Counter()
    for drawn in (
        _of_systems(asked, controller, kinds, colours),
        _of_instants(inferences, colours),
        _of_flights(asked, controller, kinds, colours),
    ):
        for system, name, figure in drawn:
            picture = f"{file_name(system.name)}-{file_name(name)}"
            taken[picture.casefold()] += 1  # other names may come to the same file's
            if taken[picture.casefold()] > 1:
                picture += f"-{taken[picture.casefold()]}"
            path = place_for(Path(output) / f"{picture}.{format}")
            save(figure, path)
            print(path)


def _fired(asked: AskedInstant, controller: "FuzzyController") -> "list[tuple[FuzzySystem, Floats]]":
    """Return the inferences that there are to draw."""
    found = list(instants(asked, controller))
    drawn = [(one.system, one.inputs) for one in found if one.inputs is not None]
    if not drawn:
        raise UserMistake("; ".join(one.note for one in found))
    return drawn


def _kinds(asked: AskedInstant, only: Sequence[str]) -> Sequence[str]:
    """Return what to draw: what is asked for, or all there is."""
    if not only:
        return [
            *KINDS[:3],
            *(["inference"] if asked.is_instant else []),
            *(["firing"] if asked.paths else []),
        ]
    if asked.is_instant and "inference" not in only:
        raise UserMistake("--inputs and --time are for an inference; add --only inference, or leave them out")
    if "firing" in only and not asked.paths:
        raise UserMistake("--only firing is for logged data; give a flight (.mcap), or add --flights FILE")
    return only


def _of_systems(
    asked: AskedInstant, controller: "FuzzyController", kinds: Sequence[str], theme: "Theme"
) -> "Pictures":
    from fis_tools import render  # noqa: PLC0415 - as above

    sensed = asked.flown(controller) or {}
    for system in controller.systems:
        if "memberships" in kinds:
            yield system, "memberships", render.memberships_figure(system, theme=theme)
        if "rules" in kinds:
            yield from ((system, *named) for named in render.rules_figures(system, theme=theme))
        for in_space in (False, True) if "surfaces" in kinds else ():
            flown = sensed.get(system.name)
            drawn = render.surface_figures(system, in_space=in_space, samples=flown, theme=theme)
            yield from ((system, *named) for named in drawn)


def _of_instants(inferences: "list[tuple[FuzzySystem, Floats]]", theme: "Theme") -> "Pictures":
    from fis_tools import render  # noqa: PLC0415 - as above

    for system, inputs in inferences:
        yield system, "inference", render.inference_figure(infer(system, inputs), theme=theme)


def _of_flights(
    asked: AskedInstant, controller: "FuzzyController", kinds: Sequence[str], theme: "Theme"
) -> "Pictures":
    from fis_tools import render  # noqa: PLC0415 - as above

    for path in asked.paths if "firing" in kinds else ():
        for flown in flights.read_flight(path, asked.all_periods, controller):
            if asked.system in (None, flown.system.name) and len(flown.time_s):
                figure = render.firing_figure(
                    flown.system,
                    flown.time_s,
                    flown.firing_strengths,
                    is_timed=flown.is_timed,
                    theme=theme,
                )
                yield flown.system, "firing", figure
