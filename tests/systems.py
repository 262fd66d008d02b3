"""Systems that come along, read once for all test files."""

from workbench.system.registry import load_system

WHEELSET = load_system("wheelset")
TRAIN = load_system("train")
