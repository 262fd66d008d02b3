"""The commands of the command line: the line of help of each, by the name of its module.

A command is one module: `add(commands, text)` adds its parser, and `run(options, output)` works and
returns a `CommandResult`. Parsing imports the module, so that what takes long to import stands
inside the functions that need it. Its `WORKERS_NEED` names the modules that worker processes import
while the command is read.
"""

COMMANDS = {
    "simulate": "run all estimators on recordings",
    "tune": "find the gains whose worst case is best",
    "diagnose": "find what the simulation gets wrong, name the cause, extend the model",
    "fit": "fit parameters of an FMU to recordings, say how sure they are",
    "next": "say which recording would tell apart what a diagnosis could not",
    "distance": "predict the distance of a stop from past ones, with its safety level",
    "monitor": "watch a machine over many recordings, say what has changed and since when",
    "power": "measure how often the diagnosis is right",
    "observability": "show when states and estimated quantities can be observed",
    "export": "write an observer as an FMU and an SSP package",
    "fmu": "build, describe and check FMUs",
    "results": "say what a folder of results holds, and compare two",
    "systems": "list the systems that are installed",
    "import": "turn log files into case folders",
    "prepare": "turn published recordings of a system into case folders",
    "check": "check that a library of effects is fit for a diagnosis",
    "new": "write a system of one's own to begin with",
    "doctor": "say what is installed, what is missing, and what to do",
    "completion": "print what a shell needs to complete commands",
}
