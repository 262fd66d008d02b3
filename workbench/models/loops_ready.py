"""Makes numba ready for compiled loops, where this is imported.

The first loop of a process makes numba look up all that it can compile, which takes a quarter of a
second even if the code of the loop is kept. Workers are forks of a process that imports this.
"""

from numba.core.registry import cpu_target

cpu_target.typing_context.refresh()
cpu_target.target_context.refresh()
