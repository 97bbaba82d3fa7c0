"""How many of something a run may have: the settings refuse more, and what grows with them is cut by these.

Documentation and tests take the numbers from here.
"""

from typing import Final

#: of anything that is counted, unless another number stands below: beyond it a run takes years, or more
#: memory than any computer has
MOST: Final = 1_000_000
#: flights of an evaluation, which are flown, stored and summarised in parts: memory hardly grows with them
MOST_CASES: Final = 100_000_000
#: starts of an evaluation that are listed in ``scenarios.csv`` before they are flown
MOST_LISTED: Final = 100_000
#: rows of a table that are written, and summarised, at a time, however many flights a part has
BLOCK_ROWS: Final = 65_536
