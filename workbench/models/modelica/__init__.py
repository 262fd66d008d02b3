"""What Modelica source says of its classes: what they extend, components, vendor annotations.

Needs no Modelica compiler.
"""

from workbench.models.modelica.check import check
from workbench.models.modelica.classes import Class, Component, Extends, Modifier
from workbench.models.modelica.files import PACKAGE, STANDARD, files, packages
from workbench.models.modelica.library import Library, read_library

__all__ = [
    "PACKAGE",
    "STANDARD",
    "Class",
    "Component",
    "Extends",
    "Library",
    "Modifier",
    "check",
    "files",
    "packages",
    "read_library",
]
