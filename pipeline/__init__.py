"""A declarative experiment pipeline for fuzzy spacecraft inspection."""

from pathlib import Path

import fis_tools
from fis_tools import compilation

compilation.use_cache_keyed_by(Path(fis_tools.__file__).parent, Path(__file__).parent)
