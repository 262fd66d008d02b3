"""The wheelset on a roller rig: virtual rig and its truth, baselines, balances, benchmarks."""

from pathlib import Path

from workbench.system.plugins import Plugin

PLUGIN = Plugin(
    commands={
        "rig": (f"{__name__}.commands.rig", "make recordings on a simulated rig"),
        "accuracy": (
            f"{__name__}.commands.accuracy",
            "score estimators against the truth of the simulated rig",
        ),
    },
    summaries=f"{__name__}.schemas:SUMMARIES",
    estimators=f"{__name__}.estimators",
    gains=Path(__file__).with_name("gains"),
    validity=f"{__name__}.validity:VALIDITY",
    balances=f"{__name__}.balances:balances",
    virtual_rig=f"{__name__}.planting:virtual_rig",
    loops=f"{__name__}.benchmark",
)
