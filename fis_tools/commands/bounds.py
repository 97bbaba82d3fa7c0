"""`bounds`: what the outputs can be, and cannot be, while the inputs lie in a region."""

from typing import Annotated, Literal

from cyclopts import Parameter

from fis_tools.analysis.bounds import NUM_BOXES, ask, output_ranges
from fis_tools.commands.arguments import Asked, UserMistake, analysing, expected, the_system


def run(
    asked: Asked,
    *,
    where: str = "",
    question: Annotated[str | None, Parameter(name="--ask")] = None,
    boxes: Annotated[int, expected("a whole number above 0", lambda count: count > 0)] = NUM_BOXES,
    expect: Literal["yes", "no"] | None = None,
) -> int:
    """Prove what the outputs can and cannot be in a region.

    Conditions are written NAME > NUMBER, NAME in [NUMBER, NUMBER] or 2 NAME - OTHER <= NUMBER; several, with
    commas between, hold together. An input beyond its range is taken as the end of it; conditions on several
    inputs together are about values inside their ranges. A yes comes with inputs and outputs that were
    evaluated. A no is proved: no inputs of the region, of any number, can do it.

    The exit status is 0; with --expect it is 1 where the answer is another one; a mistake gives 2.

    For example:

        python -m fis_tools bounds controller.yaml
        python -m fis_tools bounds controller.yaml --system force_x --where "distance > 150"
        python -m fis_tools bounds controller.yaml --system force_x --ask "force_x > 0" --expect no

    Parameters
    ----------
    where
        conditions on inputs [default: all that their ranges hold]
    question
        conditions on outputs: can they hold? [default: how far the outputs go]
    boxes
        give up after so many boxes
    expect
        with --ask: end with status 1 at any other answer
    """
    if expect is not None and question is None:
        raise UserMistake("--expect is about the answer to a question; add --ask")
    controller = asked.read()
    systems = (the_system(controller),) if where or question is not None else controller.systems
    sentences, verdict = [], None
    try:
        with analysing(controller) as tell:

            def progress(num_boxes: int, num_open: int) -> None:
                tell(f"{num_boxes} boxes, {num_open} open")

            for system in systems:
                if question is None:
                    found = output_ranges(system, where, max_boxes=boxes, progress=progress)
                    sentences += [one.sentence for one in found]
                else:
                    answer = ask(system, question, where, max_boxes=boxes, progress=progress)
                    sentences, verdict = [answer.sentence], answer.verdict
    except ValueError as error:
        raise UserMistake(str(error)) from error
    print("\n".join(sentences))
    return int(expect not in (None, verdict))
