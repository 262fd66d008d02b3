"""What Modelica source says of its classes: what they extend, components, vendor annotations.

Needs no Modelica compiler.
"""

from workbench.modelica.classes import Class, Component, Extends, Modifier
from workbench.modelica.files import beside, files, packages
from workbench.modelica.library import Library, read_library

__all__ = [
    "Class",
    "Component",
    "Extends",
    "Library",
    "Modifier",
    "beside",
    "files",
    "packages",
    "read_library",
]
