"""A declarative experiment pipeline for fuzzy spacecraft inspection."""

from pathlib import Path

import fis_tools
from fis_tools.engines import cache

cache.use_cache_keyed_by(Path(fis_tools.__file__).parent, Path(__file__).parent)
