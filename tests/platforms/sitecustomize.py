"""Python as on a system that has neither fork nor its like, nor limits of processes."""

import multiprocessing
import os
import signal
import sys

for module in ("fcntl", "resource", "pwd", "grp", "termios"):
    sys.modules[module] = None  # type: ignore[assignment]  # importing it fails
for function in ("fork", "killpg", "sched_getaffinity"):
    delattr(os, function)
os.process_cpu_count = os.cpu_count  # type: ignore[attr-defined]  # as os itself has it there
for function in ("setitimer", "siginterrupt"):
    delattr(signal, function)
multiprocessing.get_all_start_methods = lambda: ["spawn"]
multiprocessing.set_start_method("spawn")
