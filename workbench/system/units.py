"""Units of measured columns and of conditions: anything accepted becomes a factor to SI."""

import math
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from tokenize import TokenError
from typing import TYPE_CHECKING

from workbench.errors import InputError

if TYPE_CHECKING:
    import pint

_EXAMPLES = {
    "s": "s or ms",
    "Pa": "Pa, kPa or bar",
    "N.m": "N.m or kN.m",
    "rad/s": "rad/s, deg/s, rpm or 1/min",
    "N": "N or kN",
    "m/s": "m/s or km/h",
    "m": "m or mm",
    "K": "K",
}

# As Modelica and people write them: N.m, kg.m2, m3/s, J/(kg.K), W/m^2.
_UNIT = re.compile(
    r"(1/|\()*[A-Za-z\u00b5\u03bc°%]+(\^?-?[1-9])?"
    r"([.·*/]\(?[A-Za-z\u00b5\u03bc°]+(\^?-?[1-9])?\)*)*"
)
_LONGEST = 60  # characters, twice what any unit has; pint takes the square of them
_REVOLUTIONS_PER_MINUTE = frozenset({"1/min", "min-1", "min^-1", "U/min", "rpm"})
_BARE = re.compile(r"[+-]?[0-9]{1,15}(\.[0-9]+)?([eE][+-]?[0-9]{1,2})?")
_QUANTITY = re.compile(
    r"(?P<number>[+-]?[0-9]{1,15}(\.[0-9]+)?([eE][+-]?[0-9]{1,2})?+)"
    r"(?: *(?=[^0-9., ])| +(?=1(?:/|$)))(?P<unit>.*)"
)


def si_factor(unit: str, si: str, where: str) -> float:
    """Return the factor from a unit to the SI unit of its dimension.

    Per minute means revolutions where `si` is rad/s; Hz and 1/s are refused there.

    Parameters
    ----------
    unit : as a file spells it; case matters.
    si : such as s, Pa, N.m, rad/s, kg.m2; 1 for a number without a unit.
    where : place for the message of an error.

    Raises
    ------
    InputError
        If the unit is unknown, of another dimension, or ambiguous.

    Examples
    --------
    >>> si_factor("kPa", "Pa", "measured.csv")
    1000.0
    """
    if unit == si:
        return 1.0
    remedy = "convert the values, or correct the unit if it is misspelt (case matters)"
    parsed, expected = _parse(unit), _parse(si)
    if parsed is None or expected is None:
        fault = f"unknown unit [{unit}]"
    elif parsed.is_compatible_with(expected):
        return float(_units().Quantity(1.0, parsed).to(expected).magnitude)
    elif si == "rad/s" and parsed.is_compatible_with("Hz"):
        fault = f"[{unit}], which leaves open whether it counts revolutions or radians"
    else:
        fault = f"[{unit}], a unit of another dimension"
    raise InputError(
        where=where, found=fault, expected=f"a unit such as {_EXAMPLES.get(si, si)}", remedy=remedy
    )


def check_unit(unit: str, where: str) -> None:
    """Refuse a text that is no unit; 1 is that of a number."""
    if unit != "1" and _parse(unit) is None:
        raise InputError(
            where=where,
            found=f"unknown unit [{unit}]",
            expected="a unit as Modelica writes it, such as Pa, N.m, rad/s, kg.m2, or 1 for none",
            remedy="correct the unit (case matters)",
        )


def is_known_unit(unit: str) -> bool:
    """Whether a unit is one of SI, or known as multiple of one; degC, with its zero, is not."""
    try:
        check_unit(unit, "")
    except InputError:
        return False
    return True


def quotient(unit: str, divisor: str) -> str:
    """Unit of a quantity over another one, as Modelica writes it.

    >>> quotient("1/s", "(rad/s).s")
    '1/(rad.s)'
    >>> quotient("rad/s", "rad/s"), quotient("m/s2", "s")
    ('1', 'm/s3')
    """
    registry = _units()
    ratio = registry.Quantity(1.0, _pint_spelling(unit)) / registry.Quantity(
        1.0, _pint_spelling(divisor)
    )
    above: list[str] = []
    below: list[str] = []
    for name, power in ratio.to_reduced_units().unit_items():
        size = f"{abs(power):g}" if abs(power) != 1 else ""
        (above if power > 0 else below).append(registry.get_symbol(name) + size)
    whole = ".".join(above) or "1"
    if not below:
        return whole
    return f"{whole}/({'.'.join(sorted(below))})" if len(below) > 1 else f"{whole}/{below[0]}"


def _parse(unit: str) -> "pint.Unit | None":
    """A unit, or None if it is none."""
    if unit == "1":
        return _units().Unit("")
    if len(unit) > _LONGEST or not _UNIT.fullmatch(unit):
        return None
    from pint import PintError  # takes its time, and SI units need no other

    spelled = _pint_spelling(unit)
    try:
        if any(
            prefix and name in _without_prefix()
            for part in re.findall(r"[^\W\d_]+", spelled)
            for prefix, name, _ in _units().parse_unit_name(part)[:1]
        ):
            return None
        return _units().parse_units(spelled)
    except (PintError, ValueError, TokenError):  # ValueError: "nan", a number to pint
        return None


def _pint_spelling(unit: str) -> str:
    """A unit as pint reads it."""
    if unit in _REVOLUTIONS_PER_MINUTE:
        return "rpm"
    powers = re.sub(r"([A-Za-z\u00b5\u03bc°])\^?(-?\d)", r"\1**\2", unit)
    return powers.replace(".", "*").replace("·", "*").replace("%", "percent")


@cache
def _units() -> "pint.UnitRegistry[float]":
    import pint

    registry: pint.UnitRegistry[float] = pint.UnitRegistry(None)
    registry.load_definitions(_definitions().splitlines())
    return registry


@cache
def _without_prefix() -> frozenset[str]:
    """Names of units that no prefix goes before."""
    return frozenset(re.findall(r"(?m)^(\w+) =", _definitions().partition("# Without prefixes")[2]))


def _definitions() -> str:
    return Path(__file__).with_name("units.txt").read_text(encoding="utf-8")


def quantity(text: str, si: str, where: str) -> float:
    """Read a quantity such as '4.2 bar' in the SI unit `si`; see `si_factor`.

    Examples
    --------
    >>> quantity("4.2 bar", "Pa", "case.toml")
    420000.0
    >>> quantity("0.3 1/s", "1/s", "system.toml")
    0.3
    >>> quantity("1e-4", "1", "system.toml")
    0.0001
    """
    if bare := _BARE.fullmatch(text.strip()):
        if si == "1":
            return float(bare[0])
        raise InputError(
            where=where,
            found=f"{text!r}, a number without a unit",
            expected=f"a number and a unit, {_EXAMPLES.get(si, si)}",
            remedy=f"write '{text.strip()} {si}', or another unit of the same kind",
        )
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise InputError(
            where=where,
            found=repr(text),
            expected=f"a number with a decimal point and a unit, {_EXAMPLES.get(si, si)}",
            remedy="write for instance '4.2 bar' or '160 km/h'",
        )
    return float(match["number"]) * si_factor(match["unit"], si, where)


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
_LEAST = {"m2": 0.01}  # of a unit that is said, 1 unless given: areas go by squares
_STEPS = (1, 10, 100)  # of what a share is said per
_WRITTEN_OUT = 99_950.0  # up to here a number has no power of ten
_WHOLE = 0.01  # share from which on it reads as whole percents


def in_spoken_unit(values: Sequence[float], unit: str) -> tuple[list[float], str]:
    """Values in the unit in which people say the first of them.

    Parameters
    ----------
    values : in the SI `unit`; the first decides, others are ends of its interval.

    >>> in_spoken_unit([7.07e-4], "1/K"), in_spoken_unit([0.0021, 0.002], "m")
    (([7.07], '% per 100 K'), ([2.1, 2.0], 'mm'))
    >>> in_spoken_unit([1.06], "1/s"), in_spoken_unit([1.2], "1/K")
    (([1.06], '1/s'), ([1.2], '1/K'))
    >>> in_spoken_unit([0.05], "m2"), in_spoken_unit([1e-3], "m2")
    (([0.05], 'm2'), ([1000.0], 'mm2'))
    >>> in_spoken_unit([150.0], "N"), in_spoken_unit([12e3], "Pa")
    (([150.0], 'N'), ([120.0], 'mbar'))
    >>> in_spoken_unit([4.05e-4], "m2/s")
    ([0.000405], 'm2/s')
    """
    size = abs(values[0])
    numerator, _, divisor = unit.partition("/")
    # A rate is no share of anything, and neither is what is larger than all of it.
    if numerator == "1" and divisor and divisor != "s" and size < 1.0:
        step = next((n for n in _STEPS if size * n >= _WHOLE), _STEPS[-1])
        per = divisor if step == 1 else f"{step} {divisor}"
        return [round(100.0 * step * value, 12) for value in values], f"% per {per}"
    choices = _SAID.get(unit, ((unit, 1.0),))
    least = _LEAST.get(unit, 1.0) * (1.0 - 1e-9)
    shown, factor = next((c for c in choices if size >= least * c[1]), choices[-1])
    return [round(value / factor, 12) if factor != 1.0 else value for value in values], shown


def three_digits(value: float) -> str:
    """A number as people write it, to three digits.

    >>> three_digits(1500.0), three_digits(12345.0), three_digits(0.0012345), three_digits(2e6)
    ('1500', '12300', '0.00123', '2e+06')
    """
    text = f"{value:.3g}"
    return f"{float(text):.0f}" if "e+0" in text and abs(value) < _WRITTEN_OUT else text


def with_unit(value: float, unit: str) -> str:
    """A value in the unit in which people say it.

    >>> with_unit(4e-4, "1/K"), with_unit(0.02, "1"), with_unit(150.0, "N")
    ('4 % per 100 K', '2 %', '150 N')
    """
    (shown,), name = in_spoken_unit([value], unit)
    return f"{three_digits(shown)} {name}".rstrip()


def with_interval(value: float, low: float, high: float, unit: str) -> str:
    """A value with its 95 % interval, in one unit, in three digits or as many as part its ends.

    >>> with_interval(7.07e-4, 6.8e-4, 7.4e-4, "1/K")
    '7.07 % per 100 K (95 %: 6.8 to 7.4)'
    >>> with_interval(0.011, 0.01098, 0.01103, "kg.m2")
    '0.011 kg.m2 (95 %: 0.01098 to 0.01103)'
    """
    (middle, first, last), shown = in_spoken_unit([value, low, high], unit)
    further = f", {3.6 * value:.3g} km/h" if unit == "m/s" else ""
    shown = f"{shown} " * bool(shown)
    best, least, most = (three_digits(end) for end in (middle, first, last))
    if least == most:
        texts = ([f"{end:.{digits}g}" for end in (first, last)] for digits in range(4, 16))
        least, most = next((ends for ends in texts if ends[0] != ends[1]), (least, most))
    return f"{best} {shown}(95 %: {least} to {most}{further})"
