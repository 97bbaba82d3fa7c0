"""The fleet: how many deputies inspect together, and what they tell one another."""

from typing import Annotated, Literal

from pydantic import Field

from pipeline.settings import types
from pipeline.settings.conditions import Only
from pipeline.settings.groups import Settings

#: what a deputy is told and heeds: each word includes those before it
SHARING = ("nothing", "mask", "leave", "nearer")
#: added to the seed for each deputy after the first, so that each has a start and errors of its own
SEED_STEP = 1000


class Fleet(Settings, group="fleet", only=Only("fleet.deputies>1")):
    """Deputies that inspect one chief together, and exchange a mask of seen points each control period."""

    deputies: Annotated[types.Whole, Field(ge=1, le=6)] = 1
    """How many fly; each has its own start and errors, under one Sun."""
    sharing: Literal["nothing", "mask", "leave", "nearer"] = "nearer"
    """What they heed of one another: nothing; mask, the points that any has seen; leave, also those that the
    coasting of others will show; nearer, also those that no coasting shows and another is nearer to."""
    delay_periods: Annotated[types.Whole, Field(ge=0, le=60)] = 0
    """Control periods until what a deputy tells is heard; 0: it is in the same one."""
    lost_percent: Annotated[types.NotNegative, Field(le=100)] = 0.0
    """Share of messages, one from each deputy to each other in each control period, that are lost."""
    keep_apart_m: Annotated[types.NotNegative, Field(le=100)] = 0.0
    """Least distance between two deputies at a sample, which safety=filter keeps, and safety=robust where
    anything is inexact; 0: none."""
