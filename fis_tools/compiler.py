"""`compile`, under the name that it is documented by; see `fis_tools.engines.compiler`."""

from fis_tools.engines.compiler import CompiledSystem, compile

__all__ = ["CompiledSystem", "compile"]
