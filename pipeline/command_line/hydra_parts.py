"""What the command line needs of Hydra beyond its documented interface, and nowhere else.

Tried with Hydra 1.3.8. A release without one of them is told by tests/architecture/test_private_parts.py.

- ``get_args_parser`` has Hydra's own options, so that ours stand beside them.
- ``BasicSweeper`` is the sweeper by default; ``split_arguments`` makes a command's values into its runs.
"""

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra._internal.utils import get_args_parser

__all__ = ["DEFAULT_SWEEPER", "get_args_parser", "split_arguments"]

#: how its ``_target_`` ends
DEFAULT_SWEEPER = BasicSweeper.__name__
split_arguments = BasicSweeper.split_arguments
