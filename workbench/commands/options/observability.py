"""What `workbench observability` may be told."""

import argparse

from workbench.commands.arguments import (
    Commands,
    add_isolated,
    add_models,
    add_pdf,
    add_recordings,
    add_system,
    add_workers,
    example_case,
)


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    own = example_case()
    observability = commands.add_parser(
        "observability",
        help=text,
        description="Show what the measured outputs can tell: a linear test of the observer "
        "models, and for each recording how well half a second of samples can know the estimated "
        "quantities (Cramer-Rao bound). Writes windows (CSV), observability.json and figures.",
        epilog="examples:\n"
        "  python -m workbench observability\n"
        f"  python -m workbench observability {own} --out /tmp/one\n"
        "  python -m workbench observability my_cases --system my/system.toml",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_recordings(observability, out="results/observability")
    add_system(observability)
    add_models(observability)
    add_workers(observability)
    add_pdf(observability)
    add_isolated(observability)
    return observability
