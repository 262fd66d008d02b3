"""Work that `--cluster` sends to a Dask cluster."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, TypeVar

from workbench.cli.extras import require
from workbench.errors import InputError
from workbench.system.plugins import place_of
from workbench.system.system import System

if TYPE_CHECKING:
    from workbench.runtime.cluster import DaskPool

Given = TypeVar("Given")
State = TypeVar("State")


def open_cluster(
    address: str,
    begin: Callable[[Given], AbstractContextManager[State]],
    given: Given,
    limit: float,
    system: System,
    warn: Callable[[str], None] = lambda message: None,
) -> "DaskPool[State]":
    """Workers of a cluster, which must have the system's plugin, too; see DaskPool."""
    require("distributed", "cluster", "which works with a Dask cluster", "command line, --cluster")
    from workbench.runtime.cluster import DaskPool

    modules = [place_of(system.plugin).partition(":")[0]] if system.plugin else []
    try:
        return DaskPool(address, begin, given, limit, modules=modules, warn=warn)
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(
            where=f"command line, --cluster {address}",
            found=f"no scheduler ({error})",
            expected="the address of a running one, such as tcp://10.0.0.1:8786",
            remedy="start one with 'dask scheduler', and workers with 'dask worker ADDRESS'",
        ) from None
