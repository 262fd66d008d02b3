"""Quantities as people in a laboratory say them: 7.1 % per 100 K, where a model has 7.1e-4 1/K."""

import math
from collections.abc import Sequence

BAND = 1.96  # standard deviations of half a 95 % band, of a normal distribution

# Units that are said, largest first, by the SI unit of a model; the last one takes what is less.
_SAID = {
    "1": (("%", 0.01),),
    "Pa": (("bar", 1e5), ("mbar", 1e2)),
    "Pa/s": (("mbar/s", 1e2), ("mbar/min", 1e2 / 60.0)),
    "m": (("m", 1.0), ("mm", 1e-3), ("µm", 1e-6)),
    "m2": (("m2", 1.0), ("mm2", 1e-6)),
    "s": (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)),
    "N": (("kN", 1e3), ("N", 1.0)),
    "N.m": (("kN.m", 1e3), ("N.m", 1.0)),
    "N/m": (("N/mm", 1e3), ("N/m", 1.0)),
    "rad": (("°", math.pi / 180.0),),
    "J": (("MJ", 1e6), ("kJ", 1e3), ("J", 1.0)),
    "K/s": (("K/s", 1.0), ("K/min", 1.0 / 60.0), ("K/h", 1.0 / 3600.0)),
    "kg/s": (("kg/s", 1.0), ("g/s", 1e-3), ("g/min", 1e-3 / 60.0), ("mg/min", 1e-6 / 60.0)),
    "kg/(s.Pa)": (("g/(min.bar)", 1e-8 / 60.0), ("mg/(min.bar)", 1e-11 / 60.0)),
    "m3/(s.Pa)": (("l/(min.bar)", 1e-8 / 60.0), ("ml/(min.bar)", 1e-11 / 60.0)),
}
_STEPS = (1, 10, 100)  # of what a share is said per
_WHOLE = 0.01  # share from which on it reads as whole percents


def said(values: Sequence[float], unit: str) -> tuple[list[float], str]:
    """Values in the unit in which people say the first of them.

    Parameters
    ----------
    values : in the SI `unit`; the first decides, others are ends of its interval.

    >>> said([7.07e-4], "1/K"), said([0.0021, 0.002], "m")
    (([7.07], '% per 100 K'), ([2.1, 2.0], 'mm'))
    >>> said([150.0], "N"), said([12e3], "Pa"), said([4.05e-4], "m2/s")
    (([150.0], 'N'), ([120.0], 'mbar'), ([0.000405], 'm2/s'))
    """
    size = abs(values[0])
    one, _, divisor = unit.partition("/")
    if one == "1" and divisor:
        step = next((n for n in _STEPS if size * n >= _WHOLE), _STEPS[-1])
        per = divisor if step == 1 else f"{step} {divisor}"
        return [round(100.0 * step * value, 12) for value in values], f"% per {per}"
    choices = _SAID.get(unit, ((unit, 1.0),))
    shown, factor = next((c for c in choices if size >= c[1] * (1.0 - 1e-9)), choices[-1])
    return [round(value / factor, 12) if factor != 1.0 else value for value in values], shown


def with_unit(value: float, unit: str) -> str:
    """A value in the unit in which people say it.

    >>> with_unit(4e-4, "1/K"), with_unit(0.02, "1"), with_unit(150.0, "N")
    ('4 % per 100 K', '2 %', '150 N')
    """
    (shown,), name = said([value], unit)
    return f"{shown:.3g} {name}"


def with_interval(value: float, low: float, high: float, unit: str) -> str:
    """A value with its 95 % interval, in one unit.

    >>> with_interval(7.07e-4, 6.8e-4, 7.4e-4, "1/K")
    '7.07 % per 100 K (95 %: 6.8 to 7.4)'
    """
    (middle, first, last), shown = said([value, low, high], unit)
    further = f", {3.6 * value:.3g} km/h" if unit == "m/s" else ""
    return f"{middle:.3g} {shown} (95 %: {first:.3g} to {last:.3g}{further})"
