"""Tables of `system.toml` on how recordings are compared with the model, one reader each."""

import math

from workbench.errors import InputError
from workbench.expression import Expression
from workbench.system import System
from workbench.system_comparison import (
    RATE,
    Channel,
    Comparison,
    Exclusion,
    Influence,
    Leading,
    Level,
    Rest,
    Wander,
)
from workbench.system_tables import read_threshold
from workbench.tables import Table
from workbench.units import si_factor

_BLOCK, _LASTING = 5, 20  # samples of a block, and blocks of a lasting error, unless said otherwise
_LEFT = 0.03  # of a detailed model: laws that differ in form agree to some 3 %
_WAYS = ("value", "size", "rate", "integral", "turn")


def read_comparison(table: Table, system: System) -> Comparison:
    """How the diagnosis compares."""
    table.refuse_unknown(
        "begins rest leads channels tolerances levels wander excluded influences block lasting "
        "least settling left false_alarms"
    )
    block = table.number("block", "s", _BLOCK * system.sample_time)
    lasting = table.number("lasting", "s", _LASTING * block)
    tolerances, levels = table.table("tolerances"), table.table("levels")
    return Comparison(
        block=block,
        lasting=lasting,
        least=table.number("least", "s", 2.0 * lasting),
        settling=table.number("settling", "s", 0.0),
        left=table.number("left", "1", _LEFT),
        false_alarms=_rate(table),
        channels=read_channels(table.table("channels"), system),
        leading=read_leading(table.table("leads")) if "leads" in table else None,
        begins=read_threshold(table.table("begins"), system) if "begins" in table else None,
        rest=read_rest(table.table("rest"), system) if "rest" in table else None,
        tolerances={name: tolerances.number(name, "1") for name in tolerances.content},
        levels={name: read_level(levels, name) for name in levels.content},
        wander=read_wander(table.table("wander")),
        exclusions=tuple(read_exclusion(one, system) for one in table.tables("excluded")),
        influences=read_influences(table.table("influences")),
    )


def _rate(table: Table) -> float:
    rate = table.number("false_alarms", "1", RATE)
    if not 0.0 < rate < 1.0:
        raise table.wrong("false_alarms", "a share between 0 and 1")
    return rate


def read_channels(table: Table, system: System) -> tuple[Channel, ...]:
    """Channels as declared; else what is measured, one by one."""
    measured = {one.name: one for one in (*system.outputs, *system.judged)}
    if not table.content:
        usual = {n: {"is": n, "unit": one.unit, "shown": one.shown} for n, one in measured.items()}
        table = Table(usual, table.where)
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown("is unit label shown")
        unit = own.take("unit", str)
        shown = own.text("shown", unit)
        si_factor(shown, unit, f"{own.where} shown")
        label = own.text("label", measured[name].label if name in measured else name)
        formula = Expression(own.take("is", str), f"{own.where} is")
        found.append(Channel(name, unit, label, shown, formula))
    return tuple(found)


def read_influences(table: Table) -> tuple[Influence, ...]:
    """What errors may go with."""
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown("is unit way")
        way = own.text("way", "value")
        if way not in _WAYS:
            raise own.wrong("way", f"one of {', '.join(_WAYS)}")
        formula = Expression(own.take("is", str), f"{own.where} is")
        found.append(Influence(name, own.unit("unit"), formula, way))
    return tuple(found)


def read_leading(table: Table) -> Leading:
    """A slow motion that an output leads."""
    table.refuse_unknown("output together ripple")
    output = table.take("output", str)
    return Leading(output, table.texts("together") or (output,), table.number("ripple", "1", 1.0))


def read_rest(table: Table, system: System) -> Rest:
    """An input that is measured at rest."""
    table.refuse_unknown("signal output zero")
    signal = table.take("signal", str)
    system.refuse_missing(signal, f"{table.where} signal")
    unit = system.unit(signal)
    return Rest(signal, table.take("output", str), table.number("zero", unit))


def read_level(levels: Table, name: str) -> Level:
    """A parameter that differs by nature."""
    table = Table(levels.take(name, dict), f"{levels.where} {name}")
    table.refuse_unknown("by spread")
    return Level(table.text("by", ""), table.number("spread", "1", math.inf))


def read_wander(table: Table) -> dict[str, Wander]:
    """What differs along a recording."""
    found = {}
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown("share over")
        found[name] = Wander(own.number("share", "1"), own.number("over", "s"))
    return found


def read_exclusion(table: Table, system: System) -> Exclusion:
    """Samples that do not count."""
    table.refuse_unknown(
        "reason is above below from_rest within smoothed only_while to_the_end restarted uncertain"
    )
    if ("above" in table) == ("below" in table):
        raise InputError(
            where=table.where,
            found="'above' and 'below'" if "above" in table else "neither 'above' nor 'below'",
            expected="one of the two",
            remedy="say from which level on samples do not count",
        )
    while_, uncertain = table.table("only_while"), table.table("uncertain")
    return Exclusion(
        reason=table.take("reason", str),
        formula=Expression(table.take("is", str), f"{table.where} is"),
        above=table.number("above", "1", math.inf),
        below=table.number("below", "1", -math.inf),
        from_rest="from_rest" in table and table.take("from_rest", bool),
        within=table.number("within", "s", 0.0),
        smoothed=table.number("smoothed", "s", 0.0),
        only_while=read_threshold(while_, system) if "only_while" in table else None,
        to_the_end="to_the_end" in table and table.take("to_the_end", bool),
        restarted=table.texts("restarted"),
        uncertain={name: uncertain.number(name, "1") for name in uncertain.content},
    )
