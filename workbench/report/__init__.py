"""Figures, tables and files, the last stage: reads results, computes nothing."""

from workbench.report.figures import draw_case
from workbench.report.results import CaseResult, format_table, write_estimates, write_summary

__all__ = ["CaseResult", "draw_case", "format_table", "write_estimates", "write_summary"]
