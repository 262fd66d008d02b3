"""Tables of `system.toml` on what a recording may be, one reader each."""

import math
from collections.abc import Sequence

from workbench.errors import InputError, closest
from workbench.expression import Expression
from workbench.system import System
from workbench.system_parts import Cutting, Redundancy, Sampling, Store
from workbench.system_tables import positive, read_threshold, read_tolerance
from workbench.tables import Table


def read_redundancy(table: Table, system: System) -> Redundancy:
    """Two formulas that tell the same."""
    table.refuse_unknown("reason is equals stores over unit within slack only_while")
    while_ = table.table("only_while")
    side = "above" if "above" in while_ else "below"
    only = read_threshold(while_, system, side) if "only_while" in table else None
    return Redundancy(
        reason=table.take("reason", str),
        formula=Expression(table.take("is", str), f"{table.where} is"),
        other=Expression(table.take("equals", str), f"{table.where} equals"),
        unit=table.unit("unit"),
        tolerance=read_tolerance(table, table.unit("unit")),
        store=_store(table) if "stores" in table or "over" in table else None,
        while_below=only if side == "below" else None,
        while_above=only if side == "above" else None,
    )


def _store(table: Table) -> Store:
    formula = Expression(table.take("stores", str), f"{table.where} stores")
    table.take("over", str)
    return Store(formula, positive(table, "over"))


def read_cutting(table: Table, system: System) -> Cutting:
    """Which parts of a long recording are recordings of their own."""
    table.refuse_unknown("begins ends released before after")
    return Cutting(
        begins=read_threshold(table.table("begins"), system),
        ends=read_threshold(table.table("ends"), system, "below"),
        released=table.number("released", "s", 0.0),
        before=table.number("before", "s", 0.0),
        after=table.number("after", "s", 0.0),
    )


def read_sampling(table: Table) -> Sampling:
    """Which times between samples are likely."""
    table.refuse_unknown("slowest gaps")
    likely, possible = table.numbers("gaps", "s", 2) if "gaps" in table else (math.inf, math.inf)
    if likely > possible:
        raise table.wrong("gaps", "the longest likely time before the longest possible one")
    return Sampling(table.number("slowest", "s", math.inf), likely, possible)


def read_loggers(table: Table, signals: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Measured signals by the logger that records them."""
    found: dict[str, tuple[str, ...]] = {}
    for logger in table.content:
        own = table.texts(logger)
        if not logger.isidentifier() or not own:
            raise InputError(
                where=f"{table.where} {logger}",
                found="no signal"
                if logger.isidentifier()
                else f"'{logger}', a name of no one word",
                expected="a name of letters and digits, and the measured signals of this logger",
                remedy=f'write for instance second = ["{signals[0]}"]',
            )
        for k, name in enumerate(own):
            taken = next((other for other, names in found.items() if name in names), "")
            if name not in signals:
                problem = f"'{name}'{closest(name, signals)}"
            elif taken or name in own[:k]:
                problem = f"'{name}' a second time, after that of {taken or logger}"
            else:
                continue
            raise InputError(
                where=f"{table.where} {logger}",
                found=problem,
                expected=f"measured signals, each of one logger: {', '.join(signals)}",
                remedy="correct the name" if name not in signals else "name it once",
            )
        found[logger] = own
    return found
