"""The unit in which the values of a channel are, and how they become those of a signal."""

import numpy as np

from workbench.recordings.formats import FileChannel
from workbench.recordings.formats.spelling import Conversion, conversion, spelled
from workbench.system.parts import Signal
from workbench.system.system import System

# Units that recorders use and may leave out, by the SI unit of what they measure.
_USUAL = {
    "Pa": ("Pa", "kPa", "MPa", "mbar", "bar", "psi"),
    "rad/s": ("rad/s", "rpm", "rev/s", "deg/s"),
    "rad": ("rad", "deg", "rev"),
    "m/s": ("m/s", "km/h", "mph"),
    "m": ("m", "cm", "mm"),
    "N": ("N", "kN", "lbf"),
    "N.m": ("N.m", "kN.m", "lbf.ft"),
    "V": ("V", "mV"),
    "A": ("A", "mA"),
    "K": ("K", "degC"),
}
_TYPICAL = 10.0  # times the typical size of a signal, or a tenth, is what its largest sample may be


def conversion_to(unit: str, signal: Signal, system: System) -> tuple[Conversion, str] | None:
    """How values in a unit become a signal, and by which formula; None: in no way."""
    direct = conversion(unit, signal.unit)
    if direct is not None:
        return direct, ""
    other = signal.recorded_as
    found = conversion(unit, other.unit) if other is not None else None
    if other is None or found is None:
        return None
    (slope,) = other.formula.slopes((signal.name,), system.values)
    return Conversion(found.factor / slope, found.zero / slope), other.formula.text


def fitting_units(channel: FileChannel, signal: Signal, system: System) -> list[str]:
    """Usual units in which values without a unit have the signal's typical size."""
    others = _USUAL.get(signal.recorded_as.unit, ()) if signal.recorded_as else ()
    fitting: list[str] = []
    for unit in dict.fromkeys((signal.shown, *_USUAL.get(signal.unit, (signal.unit,)), *others)):
        way = conversion_to(unit, signal, system)
        if way is None:
            continue
        values = way[0].factor * channel.values + way[0].zero
        size = float(np.nanmax(np.abs(values), initial=0.0))
        low, high = signal.plausible
        typical = signal.scale / _TYPICAL <= size <= signal.scale * _TYPICAL
        if typical and np.nanmin(values) >= low and np.nanmax(values) <= high:
            fitting.append(unit)
    return fitting


def unit_in_name(name: str, signal: Signal, system: System) -> str:
    """A unit at the end of a name, as in `p_bar`; one letter may mean anything."""
    _, _, last = name.replace(" ", "_").rpartition("_")
    unit = spelled(last)
    return unit if len(last) > 1 and last != name and conversion_to(unit, signal, system) else ""
