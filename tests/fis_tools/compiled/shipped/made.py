"""Object files of functions of tests."""

import os
import re

import numba

from fis_tools.compiled import dispatchers
from fis_tools.compiled.shipped import build
from tests.places import PROJECT

#: what tells where something was compiled, or after what
TELLING = re.compile(rb"\.py\b|missing Environment|site-packages|" + re.escape(os.fsencode(PROJECT)))


def object_for(family, function, given):
    """The object file of a function, and the kind of its result."""
    python = function.py_func
    dispatcher = dispatchers.for_compiled_code(python, function.targetoptions)
    kinds = tuple(map(numba.typeof, given))
    dispatcher.compile(kinds)
    overload = dispatcher.overloads[kinds]
    text, name = overload.library.get_llvm_str(), overload.fndesc.llvm_func_name
    result = build.result_kind(overload.signature.return_type)
    return build.object_of(text, name, kinds, family, returns=bool(result)), result
