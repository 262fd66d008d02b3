"""Wheelset observer workbench: observers on FMUs, judged on measured brake stops.

The flow: case -> FMU -> observer -> run -> score -> report, one module each, in this order.
"""
