"""A declarative experiment pipeline for fuzzy spacecraft inspection."""

#: compiles what experiments need; named where compiling makes a run slow
COMPILE_COMMAND = "python -m pipeline warm"
