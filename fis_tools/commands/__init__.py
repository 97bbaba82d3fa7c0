"""The commands: one module each, whose `run` takes the arguments and whose docstring is the help."""

#: What each command does, in the order of the help. Modules are imported when they are asked for.
SUMMARIES = {
    "show": "Print variables, terms and rule tables.",
    "plot": "Draw membership functions, rules, surfaces and inferences into a folder.",
    "surface": "Evaluate an output over two inputs, as numbers or a picture.",
    "export": "Write a controller as tables, for other programs, or as C source.",
    "import": "Make one controller file from files of other programs, such as MATLAB or fuzzylite.",
    "learn": "Make a fuzzy system from a table of numbers.",
    "audit": "List what a reviewer should know: gaps, slips, idle rules.",
    "explain": "Tell why: which rules moved the output, what would flip it.",
    "firing": "Print which rules fired along logged flights, those that fired most often first.",
    "bounds": "Prove what the outputs can and cannot be in a region.",
    "domain": "Tell when logged flights left the inputs that an evaluation met.",
    "simplify": "Make a simpler controller that answers nearly the same.",
    "diff": "Tell what changed from one controller to another.",
    "review": "Write one HTML page to review a controller and sign it off.",
}
