"""What is said of a machine that differs from its data sheet: never a wrong name."""

from collections.abc import Sequence
from typing import Any

from workbench.studies.power.journal import SetVerdict


def named_wrong(result: SetVerdict) -> bool:
    """Whether a cause was named that is not the error of the sheet, nor its stated twin."""
    return any(
        not any(effect and effect in cause.group for effect in result.planting.effects)
        for cause in result.causes
    )


def summarise_sheet(results: Sequence[SetVerdict]) -> list[dict[str, Any]]:
    """What was said of each set, as it is written to sheet_error.json."""
    return [
        {
            "rig": result.planting.options,
            "wrong": dict(result.planting.gains),
            "verdict": result.verdict,
            "causes": [[cause.effect, *cause.confusable_with] for cause in result.causes],
            "wrong_name": named_wrong(result),
            "error": result.error,
        }
        for result in results
    ]
