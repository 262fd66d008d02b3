"""What `workbench observability` may be told."""

import argparse

from workbench.cli.arguments import (
    Commands,
    add_models,
    add_recordings,
    add_run,
    add_system,
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
    )
    add_recordings(observability, out="results/observability")
    add_system(observability)
    add_models(observability)
    add_run(observability)
    return observability
