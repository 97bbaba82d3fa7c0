"""The stages of a run: their names, and the order in which they run."""

from collections.abc import Iterable, Sequence

from pipeline.settings import plugged
from pipeline.settings.checks import SettingError
from pipeline.settings.keys import choices_of

#: in the order in which they run: each reads the files of those before it
STAGES = (
    *("scenario", "search", "fit", "train", "evaluate", "record"),
    *("optimum", "compare", "prove", "assure", "report"),
)
#: the stages that know of fleets; all others, also new ones, refuse them
OF_FLEETS = ("scenario", "train", "evaluate", "record", "compare", "report", "assure")


def check_stage_names(stages: Iterable[str]) -> None:
    """Raise SettingError unless each is a stage that ships, or that an installed package offers."""
    for stage in stages:
        if stage not in STAGES and stage not in plugged.names(plugged.STAGES):
            known = (*STAGES, *plugged.names(plugged.STAGES))
            raise SettingError(f"stages has {stage!r}{choices_of(stage, known, 'stages')}")


def in_order(stages: Sequence[str], *others: str) -> list[str]:
    """Return all stages in the order in which they run: those that ship, with others where a run has them.

    Parameters
    ----------
    stages : sequence of str
        Of a run, as configured: stages of one's own stand behind the one before them there.
    *others : str
        Further stages, which come last if they are none of these.
    """
    order, before = list(STAGES), ""
    for stage in stages:
        if stage not in order:
            order.insert(order.index(before) + 1 if before else 0, stage)
        before = stage
    return list(dict.fromkeys([*order, *others]))
