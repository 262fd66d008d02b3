"""What has changed on a machine, as a value: a sentence, numbers, tables, a figure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.pages.answer import finite
from workbench.studies.monitoring.estimate import watched
from workbench.studies.monitoring.state import RecordingResult
from workbench.studies.monitoring.watch import LevelChange, Track, watch
from workbench.system.system import System
from workbench.system.units import BAND

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class MonitoringResult:
    """One machine over its recordings, in the order of their dates.

    Attributes
    ----------
    names, dates : (n,) of the recordings that count.
    dated : whether their order is that of dates; else it is that of names.
    tracks : of the watched quantities.
    threshold : of the sums that raise alarms, for `rate` alarms per recording of a healthy machine.
    work : (n, w) of friction [J], by the system's `work`.
    counted : (n,) time that the estimates rest on [s].
    refused : why a recording is not used, by name.
    warned : what the FMU warned of, by name of a recording.
    again : which recording one repeats, by name.
    interrupted : whether there are more recordings, which are yet to be estimated.
    """

    system: System
    names: tuple[str, ...]
    dates: tuple[str, ...]
    dated: bool
    tracks: tuple[Track, ...]
    threshold: float
    rate: float
    work: Matrix
    counted: Vector
    refused: Mapping[str, str]
    warned: Mapping[str, str]
    again: Mapping[str, str]
    interrupted: bool

    @property
    def changes(self) -> list[tuple[Track, LevelChange]]:
        """All that were reported, in their order."""
        changes = [(track, change) for track in self.tracks for change in track.changes]
        return sorted(changes, key=lambda entry: entry[1].raised)

    @property
    def sentences(self) -> list[str]:
        """What has changed, one sentence for each quantity."""
        sentences = []
        for track in self.tracks:
            if track.changes:
                first, last = track.changes[0], track.changes[-1]
                alarms = len(track.changes)
                until = f", {alarms} alarms until {self.names[last.raised]}" * (alarms > 1)
                name = _quantity_name(track)
                called = name if track.label == name else f"{track.label} ({name})"
                sentences.append(
                    f"{called}: {self._size(track)} since "
                    f"{self.names[first.last]}; reported at {self.names[first.raised]}{until}"
                )
        return sentences

    def summary(self) -> str:
        """What has changed, for people."""
        count = len(self.names)
        lines = [f"{count} recordings, {self.names[0]} to {self.names[-1]}: "]
        lines[0] += "; ".join(
            [
                f"{len(self.changes) or 'no'} alarm{'s' * (len(self.changes) != 1)}",
                *([f"{len(self.refused)} not used"] if self.refused else []),
                *([f"{len(self.again)} there twice"] if self.again else []),
            ]
        )
        lines += self.sentences
        lines += [f"{name}: {warning}" for name, warning in self.warned.items()]
        lines += [f"not used: {name}: {why}" for name, why in self.refused.items()]
        lines += [f"there twice: {name} is {other}" for name, other in self.again.items()]
        return "\n".join(lines)

    def to_frame(self) -> "pd.DataFrame":
        """Estimates of all recordings, one row each for recording and quantity."""
        import pandas as pd

        rows = [
            {
                "recording": name,
                "date": date,
                "quantity": _quantity_name(track),
                "unit": track.unit,
                "estimate": track.values[k],
                "standard_error": track.scale * track.deviations[k],
                "off_its_past": track.surprises[k],
            }
            for k, (name, date) in enumerate(zip(self.names, self.dates, strict=True))
            for track in self.tracks
        ]
        return pd.DataFrame(rows)

    def alarms(self) -> "pd.DataFrame":
        """All alarms, in their order."""
        import pandas as pd

        columns = "told_at date quantity unit changed_after earliest latest before after change "
        columns += "standard_error share_of_nominal since_the_first"
        rows = [self._alarm(track, change) for track, change in self.changes]
        return pd.DataFrame(rows, columns=columns.split())

    def _alarm(self, track: Track, change: LevelChange) -> dict[str, Any]:
        size, deviation = change.size
        nominal = abs(self.system.values.get(track.name, 0.0))
        return {
            "told_at": self.names[change.raised],
            "date": self.dates[change.raised],
            "quantity": _quantity_name(track),
            "unit": track.unit,
            "changed_after": self.names[change.last],
            "earliest": self.names[change.earliest],
            "latest": self.names[change.latest],
            "before": change.before[0],
            "after": change.after[0],
            "change": size,
            "standard_error": deviation,
            "share_of_nominal": size / nominal if nominal else np.nan,
            "since_the_first": change.after[0] - track.changes[0].before[0],
        }

    def worked(self) -> "pd.DataFrame":
        """Work of friction in each recording [J], and seconds that the estimates rest on."""
        import pandas as pd

        labels = [f"{wear.name} [J]" for wear in self.system.work]
        frame = pd.DataFrame(self.work, columns=labels)
        frame.insert(0, "counted [s]", self.counted)
        frame.insert(0, "date", self.dates)
        frame.insert(0, "recording", self.names)
        return frame

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and texts; the keys of the first level are a contract."""
        return {
            "sentences": self.sentences,
            "recordings": len(self.names),
            "order": "dates" if self.dated else "names",
            "first": self.names[0],
            "last": self.names[-1],
            "rate": self.rate,
            "threshold": self.threshold,
            "alarms": [_without_nan(alarm) for alarm in self.alarms().to_dict("records")],
            "quantities": {
                _quantity_name(track): _without_nan(
                    {
                        "label": track.label,
                        "unit": track.unit,
                        "level": track.level[0],
                        "standard_error": track.level[1],
                        "trend_by_recording": track.trend[0],
                        "trend_standard_error": track.trend[1],
                        "scatter": track.scatter,
                        "told_in": int(np.isfinite(track.values).sum()),
                    }
                )
                for track in self.tracks
            },
            "work": self._work_sums(),
            "refused": dict(self.refused),
            "warned": dict(self.warned),
            "again": dict(self.again),
            "interrupted": self.interrupted,
        }

    def _work_sums(self) -> dict[str, dict[str, float | str]]:
        """Work of friction in all recordings, and over the mean of all that wears."""
        sums = self.work.sum(axis=0)
        mean = float(sums.mean()) if sums.size else 0.0
        return {
            wear.name: {
                "label": wear.label,
                "work": float(total),
                "of_the_mean": float(total / mean) if mean else 0.0,
            }
            for wear, total in zip(self.system.work, sums, strict=True)
        }

    def _size(self, track: Track) -> str:
        """Change since the first level with its 95 % range, and its share of the nominal value."""
        before, now = track.changes[0].before, track.level
        size, reach = now[0] - before[0], BAND * float(np.hypot(now[1], before[1]))
        low, high = size - reach, size + reach
        text = f"{size:+.3g} ({low:.3g} to {high:.3g}) {track.unit}".removesuffix(" 1")
        nominal = abs(self.system.values.get(track.name, 0.0))
        return f"{text}, {size / nominal:+.1%} of nominal" if nominal else text

    def plot(self) -> "Figure":
        """Figure of all quantities over the recordings, with their changes."""
        from workbench.studies.monitoring.report import history_figure

        return history_figure(self)

    def _repr_html_(self) -> str:
        """What has changed, and all alarms, for notebooks."""
        return f"<p>{escape(self.summary())}</p>{self.alarms().to_html(index=False)}"


def conclude(
    system: System,
    results: Sequence[RecordingResult],
    rate: float,
    folder: Path,
    *,
    interrupted: bool,
) -> MonitoringResult:
    """Watch all recordings that are known, in the order of their dates.

    Of a recording that came several times, the last one that could be used counts; of those with
    the same content, the first by name.
    """
    last = {result.name: result for result in results}
    refused = {name: last[name].refusal for name in sorted(last) if last[name].refusal}
    usable = {result.name: result for result in results if result.estimate is not None}
    first: dict[str, str] = {}  # name by content
    for name in sorted(usable):
        first.setdefault(usable[name].content, name)
    repeats = {name: first[usable[name].content] for name in sorted(usable)}
    again = {name: other for name, other in repeats.items() if name != other}
    counted = [usable[name] for name in repeats if name not in again]
    if not counted:
        why = next(iter(refused.values()), "none was estimated yet")
        raise InputError(
            where=str(folder),
            found=f"no recording that can be used; the first: {why}",
            expected="one or more",
            remedy="repair that one first",
        )
    dated = all(result.date for result in counted)
    if dated:
        counted.sort(key=lambda result: result.date)
    estimates = [result.estimate for result in counted if result.estimate is not None]
    values = np.array([estimate.values for estimate in estimates])
    covariances = [estimate.covariance for estimate in estimates]
    tracks, threshold = watch(watched(system), values, covariances, rate)
    return MonitoringResult(
        system=system,
        names=tuple(result.name for result in counted),
        dates=tuple(result.date for result in counted),
        dated=dated,
        tracks=tuple(tracks),
        threshold=threshold,
        rate=rate,
        work=np.array([estimate.work for estimate in estimates]),
        counted=np.array([estimate.counted for estimate in estimates]),
        refused=refused,
        warned={name: last[name].warned for name in sorted(last) if last[name].warned},
        again=again,
        interrupted=interrupted,
    )


def _quantity_name(track: Track) -> str:
    return f"{track.name} against the others" if track.against else track.name


def _without_nan(values: Mapping[Any, Any]) -> dict[Any, Any]:
    return {key: finite(v) if isinstance(v, float) else v for key, v in values.items()}
