"""Units as recorders spell them, and those that have a zero of their own."""

import math
import re
from dataclasses import dataclass

from workbench.errors import InputError
from workbench.system.units import check_unit, si_factor

# Spellings that mean one unit alone. Case matters elsewhere: mN is no MN.
_SPELLINGS = {
    "-": "1", "--": "1", "[-]": "1", "none": "1", "ohne": "1",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "Sek": "s", "Sek.": "s", "sek": "s",
    "Sekunden": "s", "msec": "ms", "millisecond": "ms", "milliseconds": "ms",
    "usec": "us", "hr": "h", "hours": "h", "minutes": "min", "days": "d",
    "kmh": "km/h", "km/std": "km/h", "kph": "km/h", "KM/H": "km/h", "Km/h": "km/h",
    "kPA": "kPa", "KPa": "kPa", "Bar": "bar", "BAR": "bar", "mBar": "mbar", "pa": "Pa",
    "RPM": "rpm", "Rpm": "rpm", "r/min": "rpm", "U/Min": "rpm", "1/Min": "rpm", "upm": "rpm",
    "Upm": "rpm", "rev/min": "rpm", "/min": "1/min",
    "Umdr/min": "rpm", "U/s": "rev/s",
    "NM": "N.m", "N m": "N.m", "N*m": "N.m", "kN m": "kN.m", "kNM": "kN.m", "KN": "kN",
    "KNm": "kNm",
    "DegC": "degC", "°C": "degC", "deg C": "degC", "degC": "degC", "C": "degC", "Grad C": "degC",
    "Deg C": "degC", "Deg_C": "degC", "deg_C": "degC", "DEG C": "degC", "degrees C": "degC",
    "Celsius": "degC", "celsius": "degC", "°c": "degC", "Deg F": "degF", "deg_F": "degF",
    "meters/second": "m/s", "Meters/Second": "m/s", "Watts": "W", "Watt": "W", "Amps": "A",
    "℃": "degC", "°F": "degF", "degF": "degF", "deg F": "degF", "Kelvin": "K",
    "Grad": "deg", "Grad/s": "deg/s", "degrees": "deg", "radians": "rad", "rad/sec": "rad/s",
    "m/sec": "m/s", "m/s/s": "m/s2", "Volt": "V", "Volts": "V", "Newton": "N", "metre": "m",
    "ft.lb": "lbf.ft", "ft*lb": "lbf.ft", "ft-lb": "lbf.ft", "ft lb": "lbf.ft", "ftlb": "lbf.ft",
    "ft.lbf": "lbf.ft", "ft*lbf": "lbf.ft", "ft-lbf": "lbf.ft", "ft lbf": "lbf.ft",
    "lb.ft": "lbf.ft", "lb*ft": "lbf.ft", "lb-ft": "lbf.ft", "lb ft": "lbf.ft", "lbft": "lbf.ft",
    "lbf*ft": "lbf.ft", "lbf-ft": "lbf.ft", "lbf ft": "lbf.ft", "lbfft": "lbf.ft",
    "kp": "kgf", "kp/cm2": "kgf/cm2", "kg/cm2": "kgf/cm2", "kgf/cm^2": "kgf/cm2",
    "kp/cm^2": "kgf/cm2", "kg/cm^2": "kgf/cm2",
    "meter": "m", "Meter": "m", "Prozent": "%", "percent": "%", "‰": "permille",
}  # fmt: skip
# A unit with a factor: 1/10 s, 0.1 s, 10 ms, 10^-3 l/s, 1e-6 s.
_MULTIPLE = re.compile(
    r"[x*]?\s*(?P<number>\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)(?:\s*/\s*(?P<parts>\d+)"
    r"|\^(?P<power>[+-]?\d{1,2}))?\s*[*.]?\s*(?P<unit>[^\W\d].*)"
)
# A pressure above that of the air, or above nothing: barg, bar(g), bar rel, psia, kPa abs.
_FROM_ZERO = re.compile(
    r"(?P<unit>\w*(?:bar|psi|Pa))\s*\(?(?:(?P<gauge>g|gauge|rel|ü)|a|abs)\.?\)?", re.IGNORECASE
)
_POWERS = str.maketrans({"²": "2", "³": "3", "⁻": "-", "¹": "1", "·": ".", "⋅": "."})
# Value in SI of one, and of zero, where a factor alone is not enough: temperatures; and units of
# trade that the workbench's own files do not have.
_OTHER = {
    "degC": ("K", 1.0, 273.15),
    "degF": ("K", 5.0 / 9.0, 459.67 * 5.0 / 9.0),
    "psi": ("Pa", 6894.757293168361, 0.0),  # 0.45359237 kg * 9.80665 m/s2 / (25.4 mm)^2
    "mph": ("m/s", 0.44704, 0.0),
    "lbf": ("N", 4.4482216152605, 0.0),
    "lbf.ft": ("N.m", 4.4482216152605 * 0.3048, 0.0),
    "kgf": ("N", 9.80665, 0.0),
    "kgf/cm2": ("Pa", 98066.5, 0.0),
    "in": ("m", 0.0254, 0.0),
    "ft": ("m", 0.3048, 0.0),
    "gon": ("rad", math.pi / 200.0, 0.0),
    "ns": ("s", 1e-9, 0.0),
    "d": ("s", 86400.0, 0.0),
}


@dataclass(frozen=True)
class Conversion:
    """From a unit of a file to SI: `factor*value + zero`."""

    factor: float
    zero: float = 0.0


def spell_unit(text: str) -> str:
    """A unit as the workbench spells it, from what stands in a file; empty: nothing stands there.

    >>> spell_unit("[ U/Min ]"), spell_unit("m/s²"), spell_unit("-"), spell_unit("kNm")
    ('rpm', 'm/s2', '1', 'kNm')
    """
    bare = text.strip()
    for marks in ("[]", "()", "{}", "<>"):
        if bare[:1] == marks[0] and bare[-1:] == marks[1]:
            bare = bare[1:-1].strip()
    bare = bare.strip("'\"").strip().translate(_POWERS).replace("**", "^")
    return _SPELLINGS.get(bare, bare)


def conversion(unit: str, si: str) -> Conversion | None:
    """How values in a unit become SI, or None if the unit is none, or of another dimension.

    Parameters
    ----------
    unit : as `spell_unit`.
    """
    unit, _ = pressure_zero(unit) if si == "Pa" else (unit, "")
    base, factor, zero = _OTHER.get(unit, (unit, 1.0, 0.0))
    try:
        return Conversion(factor * si_factor(base, si, ""), zero)
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
        return unit in _OTHER
    return True


_NAMED = re.compile(
    r"(?P<name>.*?)\s*(?:\[(?P<square>[^\[\]]*)\]|[({<](?P<round>[^(){}<>]*)[)}>])\s*"
)
_WITHIN = re.compile(r"(?P<name>.*\S)\s*\[(?P<unit>[^\[\]]+)\]\s*(?P<rest>\S.*)")
_TRAILING = re.compile(r"(?P<name>.*\S)\s*(?:\s/\s?|\s+in\s+|,\s*)(?P<unit>\S+)")


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
