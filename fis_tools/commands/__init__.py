"""The commands: a function each, which takes the arguments and whose docstring is the help."""

#: Which module has each command, and what it does, in the order of the help; a module is imported when it
#: is asked for.
COMMANDS = {
    "show": ("views", "Print variables, terms and rule tables."),
    "plot": ("views", "Draw membership functions, rules, surfaces and inferences into a folder."),
    "surface": ("views", "Evaluate an output over two inputs, as numbers or a picture."),
    "export": ("files", "Write a controller as tables, for other programs, or as C source."),
    "import": (
        "files",
        "Make one controller file from files of other programs, such as MATLAB or fuzzylite.",
    ),
    "learn": ("files", "Make a fuzzy system from a table of numbers."),
    "audit": ("findings", "List what a reviewer should know: gaps, slips, idle rules."),
    "explain": ("findings", "Explain an output: which rules moved it, what would flip it."),
    "bounds": ("analysis", "Prove what the outputs can and cannot be in a region."),
    "domain": ("analysis", "Report when logged flights left the operational domain."),
    "simplify": ("findings", "Make a simpler controller that answers nearly the same."),
    "diff": ("findings", "Tell what changed from one controller to another."),
    "edit": ("views", "Edit a controller on a page that answers every touch."),
    "review": ("views", "Write one HTML page to review a controller and sign it off."),
}
