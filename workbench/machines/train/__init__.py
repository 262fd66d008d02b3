"""A train of two vehicles: a virtual one, recorded sets, and what its own computer writes."""

from workbench.system.plugins import Plugin

PLUGIN = Plugin(
    virtual_rig=f"{__name__}.planting:virtual_rig",
    recorded_sets=f"{__name__}.recorded:recorded_sets",
    published=f"{__name__}.published:PUBLISHED",
)
