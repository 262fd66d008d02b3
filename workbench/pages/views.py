"""What the panels of a figure show, and how signals are written for people."""

import re
from collections.abc import Sequence

from workbench.system.parts import Threshold, View
from workbench.system.system import System
from workbench.system.units import si_factor

_NUMBER = re.compile(r"(?<![\w.\[])-?\d+(\.\d+)?(e[+-]?\d+)?(?![\w\]])")  # within a sentence
_JUDGED_HEIGHT = 1.8  # the judged signal has room for several curves on top of each other


def views(system: System) -> tuple[View, ...]:
    """Panels that the system declares; else all its signals, those of one unit together."""
    if system.panels:
        return system.panels
    reference = system.objective.signal
    outputs: dict[str, list[str]] = {}
    for output in system.outputs:
        if output.name != reference:
            outputs.setdefault(output.shown, []).append(output.name)
    return (
        *(_view(system, names) for names in outputs.values()),
        *(_view(system, [signal.name], 0.55) for signal in system.inputs),
        _view(system, [reference], _JUDGED_HEIGHT),
        *(_view(system, [quantity.name], 0.8) for quantity in system.estimated),
    )


def _view(system: System, signals: Sequence[str], height: float = 1.0) -> View:
    lines = ["solid", *["dashed"] * (len(signals) - 1)]
    names = [
        named(system, name) + (f" ({line})" if len(signals) > 1 else "")
        for name, line in zip(signals, lines, strict=True)
    ]
    title = ", ".join(names)
    return View(capital(title), "", tuple(signals), height, None, None)


def named(system: System, signal: str) -> str:
    """Label and name of a signal, or its name where it has no other."""
    text = called(system, signal)
    return signal if text == signal else f"{text} {signal}"


def capital(text: str) -> str:
    """A text as it begins a title.

    >>> capital("level of the tank")
    'Level of the tank'
    """
    return text[:1].upper() + text[1:]


def called(system: System, signal: str) -> str:
    """What a signal is, for people."""
    labels = {name: signal.label for name, signal in system.signals.items()}
    labels |= {signal.name: signal.label for signal in system.derived}
    labels |= {quantity.name: quantity.label for quantity in system.estimated}
    return labels.get(signal, signal)


def shown_unit(system: System, signal: str) -> str:
    """Unit in which people read a signal."""
    return system.signals[signal].shown if signal in system.signals else system.unit(signal)


def per_shown(system: System, signal: str, unit: str) -> float:
    """SI value of a signal that is one of the unit of its panel."""
    return si_factor(unit, system.unit(signal), f"{system.source}, [[figures]] {signal}")


def titled(view: View, unit: str) -> str:
    """Title of a panel with its unit.

    >>> titled(View("Valve", "open at 1", ("v",), 1.0, None, None), "1")
    'Valve [1], open at 1'
    """
    return f"{view.title} [{unit}]" + (f", {view.note}" if view.note else "")


def level(system: System, threshold: Threshold) -> str:
    """A threshold for people, such as 'pressure above 0.1 bar'."""
    unit = shown_unit(system, threshold.signal)
    value = threshold.level / per_shown(system, threshold.signal, unit)
    return f"{threshold.signal} above {value:.6g} {unit}"


def window(system: System) -> str:
    """What begins and ends the time that is judged, for people."""
    objective = system.objective
    begins = f"from the first {level(system, objective.begins)}" if objective.begins else ""
    ends = f"to the last {level(system, objective.ends)}" if objective.ends else ""
    return f"{begins} {ends}".strip() or "over the whole recording"


def below(system: System) -> str:
    """The bandwidth in which errors count, for people; empty where all of them do."""
    bandwidth = system.objective.bandwidth
    return f"below {bandwidth:g} Hz" if bandwidth < float("inf") else ""


def inverse(unit: str) -> str:
    """The unit of a weight.

    >>> inverse("rad/s"), inverse("N"), inverse("N.m")
    ('s/rad', '1/N', '1/(N.m)')
    """
    above, slash, under = unit.partition("/")
    if slash and above != "1" and not set(above + under) & set("./()"):
        return f"{under}/{above}"
    return f"1/({unit})" if set(unit) & set("./") else f"1/{unit}"


def rounded(value: float) -> str:
    """A number in two digits or more, without decimals where it has enough.

    >>> rounded(553.1), rounded(0.04213)
    ('553', '0.042')
    """
    return f"{value:.0f}" if abs(value) >= 10.0 else f"{value:.2g}"


def numberless(text: str) -> str:
    """A sentence whose numbers are zero, to find those that differ in them alone.

    >>> numberless("x[1] is up to 3.5e+07 m/s"), numberless("v2 is 12")
    ('x[1] is up to 0 m/s', 'v2 is 0')
    """
    return _NUMBER.sub("0", text)


def amount(value: float, unit: str) -> str:
    """A rounded number with its unit, which a plain number has not.

    >>> amount(553.1, "N"), amount(5.8512, "1")
    ('553 N', '5.9')
    """
    return f"{rounded(value)} {unit}".removesuffix(" 1")


def percent(share: float) -> str:
    """A share in percent, as tables and figures give it.

    >>> percent(0.01117)
    '1.12 %'
    """
    return f"{100 * share:.2f} %"


def errs_least(errors: Sequence[tuple[float, str]]) -> str:
    """Say who errs least, or who tie: those whose errors are the same as they are shown.

    Parameters
    ----------
    errors : share and name of each, the least first.

    >>> errs_least([(0.0043, "UKF"), (0.0051, "EKF")])
    'The UKF errs least'
    >>> errs_least([(0.00431, "UKF"), (0.00432, "EKF"), (0.62, "open loop")])
    'The UKF and the EKF tie'
    """
    names = [name for share, name in errors if percent(share) == percent(errors[0][0])]
    if len(names) == 1:
        return f"The {names[0]} errs least"
    return f"The {', the '.join(names[:-1])} and the {names[-1]} tie"


def duration(seconds: float) -> str:
    """A time for people.

    >>> duration(0.05), duration(1.0), duration(300.0)
    ('50 ms', '1 s', '300 s')
    """
    return f"{1e3 * seconds:g} ms" if seconds < 0.5 else f"{seconds:g} s"
