"""What the command line needs of Hydra beyond its documented interface, and nowhere else.

Tried with Hydra 1.3.8. A release without one of them is told by tests/architecture/test_private_parts.py.

- ``get_args_parser`` has Hydra's own options, so that ours stand beside them.
- ``ConfigLoaderImpl`` composes; Hydra makes one by its name in the module ``hydra``, and would compose each
  run twice, first to read ``hydra.mode`` alone.
- ``BasicSweeper`` is the sweeper by default; ``split_arguments`` makes a command's values into its runs.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from hydra._internal import hydra as machinery
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra._internal.utils import get_args_parser
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

__all__ = ["DEFAULT_SWEEPER", "composing_once", "get_args_parser", "split_arguments"]

#: how its ``_target_`` ends
DEFAULT_SWEEPER = BasicSweeper.__name__
split_arguments = BasicSweeper.split_arguments
#: the name by which Hydra makes what composes
MADE = ConfigLoaderImpl.__name__
#: what Hydra adds to the overrides of a run whose configuration has no mode
AS_A_RUN = f"hydra.mode={RunMode.RUN.name}"


class OnceComposed(ConfigLoaderImpl):
    """Composes a run where its mode is read, and hands the same out when it is run.

    Where that composition fails, or it is of a sweep, all is left to Hydra.
    """

    _kept: tuple[list[str], DictConfig] | None = None

    def load_configuration(
        self,
        config_name: str | None,
        overrides: list[str],
        run_mode: RunMode,
        from_shell: bool = True,
        validate_sweep_overrides: bool = True,
    ) -> DictConfig:
        """Compose a configuration; see Hydra's."""
        kept, self._kept = self._kept, None
        if kept is not None and run_mode == RunMode.RUN and overrides == [*kept[0], AS_A_RUN]:
            config = kept[1]
            config.hydra.mode = RunMode.RUN
            config.hydra.overrides.hydra.append(AS_A_RUN)
            return config
        if run_mode == RunMode.MULTIRUN and not validate_sweep_overrides:  # to read the mode
            with suppress(HydraException, OmegaConfBaseException):
                config = super().load_configuration(config_name, overrides, RunMode.RUN, from_shell)
                if config.hydra.mode is None:
                    self._kept = list(overrides), config
                    return config
        return super().load_configuration(
            config_name, overrides, run_mode, from_shell, validate_sweep_overrides
        )


@contextmanager
def composing_once() -> Iterator[None]:
    """Let Hydra's application compose a run once within a block."""
    vars(machinery)[MADE] = OnceComposed
    try:
        yield
    finally:
        vars(machinery)[MADE] = ConfigLoaderImpl
