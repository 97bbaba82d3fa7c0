"""The commands: one module each, with `add`, which declares its arguments, `run` and `EPILOG`."""

#: What each command does, in the order of the help. Modules are imported when they are asked for.
SUMMARIES = {
    "show": "print variables, terms and rule tables",
    "plot": "draw membership functions, rules, surfaces and inferences into a folder",
    "surface": "evaluate an output over two inputs, as numbers or a picture",
    "export": "write a controller as tables, for other programs, or as C source",
    "import": "make one controller file from files of MATLAB, fuzzylite or IEEE 1855",
    "learn": "make a fuzzy system from a table of numbers",
    "audit": "list what a reviewer should know: gaps, slips, idle rules",
    "explain": "tell why: which rules moved the output, what would flip it",
    "firing": "print which rules fired along logged flights, those that fired most often first",
    "bounds": "prove what the outputs can and cannot be in a region",
    "domain": "tell when logged flights left the inputs that an evaluation met",
    "simplify": "make a simpler controller that answers nearly the same",
    "diff": "tell what changed from one controller to another",
    "review": "write one HTML page to review a controller and sign it off",
}
