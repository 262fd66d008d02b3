"""Figures, tables and files, the last stage: reads results, computes nothing."""

from workbench.report.figures import CaseFigure, draw_case
from workbench.report.live import LiveWindow
from workbench.report.page import write_page
from workbench.report.results import (
    format_table,
    summarise_runs,
    write_estimates,
)
from workbench.report.run_figures import case_figure

__all__ = [
    "CaseFigure",
    "LiveWindow",
    "case_figure",
    "draw_case",
    "format_table",
    "summarise_runs",
    "write_estimates",
    "write_page",
]
