"""Units as recorders spell them, and those that have a zero of their own."""

import math
import re
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.system.units import check_unit, si_factor

# Spellings that mean one unit alone. Case matters elsewhere: mN is no MN.
_SPELLINGS = {
    "-": "1", "--": "1", "[-]": "1", "none": "1", "ohne": "1",
    "secs": "s", "second": "s", "Second": "s", "seconds": "s", "Sek": "s", "Sek.": "s", "sek": "s",
    "Sekunden": "s", "msec": "ms", "millisecond": "ms", "milliseconds": "ms",
    "usec": "us", "hours": "h", "hrs": "h", "Std.": "h", "Stunden": "h", "minutes": "min",
    "Minuten": "min", "days": "d", "Tage": "d",
    "km/std": "km/h", "KM/H": "km/h", "Km/h": "km/h",
    "Mpa": "MPa", "MPA": "MPa", "MHZ": "MHz", "Mhz": "MHz", "mBar": "mbar", "pa": "Pa",
    "US gpm": "gpm", "US GPM": "gpm", "USGPM": "gpm", "US gal": "gal", "iwc": "inWC",
    "CMH": "m3/h", "cmh": "m3/h", "cbm/h": "m3/h", "r.p.m.": "rpm", "°K": "K", "g's": "g",
    "Rpm": "rpm", "r/min": "rpm", "U/Min": "rpm", "1/Min": "rpm", "upm": "rpm",
    "Upm": "rpm", "rev/min": "rpm", "/min": "1/min", "tr/min": "rpm",
    "Umdr/min": "rpm", "U/s": "rev/s",
    "NM": "N.m", "N m": "N.m", "kN m": "kN.m", "kNM": "kN.m", "KN": "kN", "KNm": "kNm",
    "C": "degC", "Grad C": "degC", "Celsius": "degC", "celsius": "degC", "Cel": "degC",
    "meters/second": "m/s", "Meters/Second": "m/s", "Watts": "W", "Watt": "W", "Amps": "A",
    "℃": "degC", "℉": "degF", "Kelvin": "K", "kelvin": "K",
    "Grad": "deg", "Grad/s": "deg/s", "degrees": "deg", "Deg": "deg", "º": "deg",
    "radians": "rad", "m/s/s": "m/s2", "Volt": "V", "Volts": "V", "Newton": "N", "metre": "m",
    "meter": "m", "Meter": "m", "inches": "in", "feet": "ft", "micron": "um", "microns": "um",
    "kp/cm2": "kgf/cm2", "kg/cm2": "kgf/cm2", "kgf/cm^2": "kgf/cm2",
    "kp/cm^2": "kgf/cm2", "kg/cm^2": "kgf/cm2", "in Hg": "inHg", "mm Hg": "mmHg", "psid": "psi",
    "%RH": "%", "% RH": "%", "%rH": "%", "% rH": "%", "%rF": "%", "% rF": "%", "% r.F.": "%",
    "Prozent": "%", "percent": "%", "pct": "%", "‰": "permille", "µε": "um/m",
}  # fmt: skip
# Units that mean the same whatever their case, as no other has their letters: KW, kpa. Mpa is MPa
# above, and mpa may be millipascal.
_ANY_CASE = {
    unit.casefold(): unit
    for unit in (
        *("kPa", "hPa", "bar", "kW", "kWh", "kV", "Hz", "kHz", "kg", "kgf", "km", "sec", "hrs"),
        *("l/min", "l/h", "l/s", "m3/h", "m3/hr", "m3/s", "m3/min"),
        *("kg/h", "kg/hr", "kg/s", "kg/min", "ltr"),
    )
}
# Units that mean the same in capitals: PSI, MPH.
_IN_CAPITALS = re.compile(
    "psid?|ksi|mph|kph|fps|fpm|gpm|cfm|cfs|lpm|lps|kts|ft|lb[sf]?|rpm|rps|deg", re.IGNORECASE
)
_FORCE = r"(lb|oz)f?s?"
_TORQUE = re.compile(rf"({_FORCE})[ .*-]?(ft|in)|(ft|in)[ .*-]?({_FORCE})", re.IGNORECASE)
_DEGREES = re.compile(
    r"([\u00b0\u00ba]|deg(rees?)?\.?)[ _]?(?P<scale>[CF])(elsius|ahrenheit)?", re.IGNORECASE
)
_AROUND = re.compile(r" ?([/*.]) ?|(?<=[A-Za-z])-(?=[A-Za-z])| (?=[A-Za-z]+\^?-[1-9])")
_OF_WATER = re.compile(r"(?:(?<=[mn])|(?<=ft))[. ]*(H2[O0]|w\.?c\.?|WG)", re.IGNORECASE)
_OF_CURRENT = re.compile(r"(?P<unit>[mkuµ]?[VA])[ _]?(?i:dc|ac|rms)")
# A unit with a factor: 1/10 s, 0.1 s, 10 ms, 10^-3 l/s, 1e-6 s.
_MULTIPLE = re.compile(
    r"[x*]?\s*(?P<number>\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)(?:\s*/\s*(?P<parts>\d+)"
    r"|\^(?P<power>[+-]?\d{1,2}))?\s*[*.]?\s*(?P<unit>[^\W\d].*)"
)
# A pressure above that of the air, or above nothing: barg, bar(g), bar rel, psia, kPa abs.
_FROM_ZERO = re.compile(
    r"(?P<unit>\w*(?:bar|psi|Pa)|kgf?/cm\^?2)\s*\(?(?:(?P<gauge>g|gauge|rel|ü)|a|abs)\.?\)?",
    re.IGNORECASE,
)
_SIGNS = str.maketrans(
    {"²": "2", "³": "3", "⁻": "-", "¹": "1", "·": ".", "⋅": ".", "\u03a9": "Ohm", "\u2126": "Ohm"}
)
# What SI has, and nobody measures in: Ms is written for ms, Mm for mm.
_NEVER = frozenset({"Mm", "Ms"})
# Temperatures have a zero of their own in SI; and what a unit is for a quantity that has no other.
_SCALES = {"degC": (1.0, 273.15), "degF": (5.0 / 9.0, 459.67 * 5.0 / 9.0)}
_FOR = {
    "m/s2": {"g": "gn", "G": "gn", "mg": "mgn"},
    "N": {"lb": "lbf", "lbs": "lbf"},
    "K": {"F": "degF"},
}


@dataclass(frozen=True)
class Conversion:
    """From a unit of a file to SI: `factor*value + zero`."""

    factor: float
    zero: float = 0.0

    def applied(self, values: Vector) -> Vector:
        """Values in SI, (n,), of those of a file; what no machine reads may be infinite."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self.factor * values + self.zero


def spell_unit(text: str) -> str:
    """A unit as the workbench spells it, from what stands in a file; empty: nothing stands there.

    >>> spell_unit("[ U/Min ]"), spell_unit("m/s²"), spell_unit("-"), spell_unit("kNm")
    ('rpm', 'm/s2', '1', 'kNm')
    """
    bare = text.strip()
    for marks in ("[]", "()", "{}", "<>"):
        if bare[:1] == marks[0] and bare[-1:] == marks[1]:
            bare = bare[1:-1].strip()
    bare = bare.strip("'\"").strip().translate(_SIGNS).replace("**", "^")
    if bare.isupper() and _IN_CAPITALS.fullmatch(bare):
        bare = bare.lower()
    if match := _TORQUE.fullmatch(bare):
        force, arm = (match[1], match[3]) if match[1] else (match[5], match[4])
        return f"{force[:2]}f.{arm}".lower()
    if match := _DEGREES.fullmatch(bare):
        return f"deg{match['scale'].upper()}"
    if match := _OF_CURRENT.fullmatch(bare):
        return match["unit"]
    if bare not in _SPELLINGS:
        bare = _OF_WATER.sub("WC", _AROUND.sub(lambda sign: sign[1] or ".", bare))
    return _SPELLINGS.get(bare, _ANY_CASE.get(bare.casefold(), bare))


def conversion(unit: str, si: str) -> Conversion | None:
    """How values in a unit become SI, or None if the unit is none, or of another dimension.

    Parameters
    ----------
    unit : as `spell_unit`.
    """
    unit, _ = pressure_zero(unit) if si == "Pa" else (unit, "")
    unit = _FOR.get(si, {}).get(unit, unit)
    if unit in _NEVER:
        return None
    factor, zero = _SCALES.get(unit, (1.0, 0.0))
    try:
        return Conversion(factor * si_factor("K" if zero else unit, si, ""), zero)
    except InputError:
        counted = multiple(unit, si)
        return counted[1] if counted else None


def pressure_zero(unit: str) -> tuple[str, str]:
    """Unit without what it says of its zero, and that: "gauge", "absolute", or nothing.

    >>> pressure_zero("barg"), pressure_zero("kPa abs"), pressure_zero("mbar")
    (('bar', 'gauge'), ('kPa', 'absolute'), ('mbar', ''))
    """
    match = _FROM_ZERO.fullmatch(unit)
    base = spell_unit(match["unit"]) if match else unit
    if match is None or conversion(base, "Pa") is None:
        return unit, ""
    return base, "gauge" if match["gauge"] else "absolute"


def multiple(unit: str, si: str) -> tuple[str, Conversion] | None:
    """The unit of a unit with a factor, and how counts become SI; None if it is no such unit.

    >>> multiple("0.1 l/s", "m3/s")
    ('l/s', Conversion(factor=0.0001, zero=0.0))
    """
    match = _MULTIPLE.fullmatch(unit)
    own = spell_unit(match["unit"]) if match else ""
    scale = conversion(own, si) if match and not _MULTIPLE.fullmatch(own) else None
    if match is None or scale is None or scale.zero:
        return None
    number = float(match["number"].replace(",", "."))
    parts = float(match["parts"] or 1.0)
    size = number ** float(match["power"]) if match["power"] else number / (parts or math.inf)
    return (own, Conversion(size * scale.factor)) if 0.0 < size < math.inf else None


def is_unit(text: str) -> bool:
    """Whether a text is a unit that can be converted, or a sign for none."""
    unit, _ = pressure_zero(spell_unit(text))
    if multiple(unit, "s") is not None:
        return True
    try:
        check_unit(unit, "")
    except InputError:
        return unit in _SCALES
    return unit not in _NEVER


_NAMED = re.compile(
    r"(?P<name>(?:.*?\S)?)\s*(?:\[(?P<square>[^\[\]]*)\]|[({<](?P<round>[^(){}<>]*)[)}>])\s*"
)
_WITHIN = re.compile(r"(?P<name>.*\S)\s*\[(?P<unit>[^\[\]]+)\]\s*(?P<rest>\S.*)")
# V(h) and I(R1) of circuits: a voltage of a node, a current through a part, not in hours.
_OF_CIRCUIT = re.compile(r"(?P<kind>[VI])\((?P<of>[^()]+)\)", re.IGNORECASE)
_KINDS_OF_CIRCUIT = {"V": ("V", "m/s", "m3"), "I": ("A",)}
_TRAILING = re.compile(
    r"(?P<name>.*?\S)(?:\s+/\s?|\s+in\s+|\s*,\s*)(?P<unit>\S+)(\s+\((LGR|SEN) S/N.*\))?"
)


def name_and_unit(cell: str) -> tuple[str, str]:
    """Name and unit of a column; the unit is empty where none is told.

    >>> [name_and_unit(text) for text in ("pC [bar]", "pC (bar)", "Kraft (gefiltert)")]
    [('pC', 'bar'), ('pC', 'bar'), ('Kraft (gefiltert)', '')]
    >>> name_and_unit("Druck in bar")
    ('Druck', 'bar')
    >>> name_and_unit("flow (1)")
    ('flow (1)', '')
    """
    text = cell.strip().strip("'\"").strip()
    if match := _OF_CIRCUIT.fullmatch(text):
        units = _KINDS_OF_CIRCUIT[match["kind"].upper()]
        if not any(conversion(spell_unit(match["of"]), unit) for unit in units):
            return text, ""
    if match := _NAMED.fullmatch(text):
        unit = match["square"] if match["square"] is not None else match["round"]
        # A number is one of a channel, not its unit; [1] is none of a quantity without one.
        number = unit.strip().isdecimal() and (match["square"] is None or unit.strip() != "1")
        if match["name"] and not number and (match["square"] is not None or is_unit(unit)):
            return match["name"], spell_unit(unit)
    if (match := _WITHIN.fullmatch(text)) and is_unit(match["unit"]) and match["unit"] != "1":
        return f"{match['name']} {match['rest']}", spell_unit(match["unit"])
    if (match := _TRAILING.fullmatch(text)) and is_unit(match["unit"]):
        return match["name"], spell_unit(match["unit"])
    return text, ""
