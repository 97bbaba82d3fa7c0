"""Machine code that comes with the product, so that its commonest flights wait for no compiler.

`build` makes it from what numba compiled, and `load` links it by llvmlite, without numba. It is used where
the source, the constants and the types of the arguments are those it was made from; everything else is
compiled.
"""
