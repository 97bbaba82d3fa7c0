"""Fuzzy inference systems as readable data, with a compiled evaluator and the means to review them."""

from pathlib import Path

from fis_tools import compilation

compilation.use_cache_keyed_by(Path(__file__).parent)
