"""What `workbench accuracy` may be told."""

import argparse

from workbench.cli.arguments import Commands, add_pdf, add_recordings, add_system, example_case


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    own = example_case()
    accuracy = commands.add_parser(
        "accuracy",
        help=text,
        description="Judge estimators against the truth (truth.csv) that 'workbench rig' writes "
        "beside each recording and no estimator reads: force in the contact, a slide, friction of "
        "the pads. Prints the worst stops (dry discs, wet discs, stops whose truth has a slide); "
        "writes every stop (accuracy.csv) and the same with the worst (accuracy.json), with what "
        "95 % bands must be multiplied by to hold 95 % of the truth ('bands').",
        epilog="examples:\n"
        "  python -m workbench accuracy\n"
        "  python -m workbench rig --seed 1 --out /tmp/rig\n"
        "  python -m workbench accuracy /tmp/rig --out /tmp/accuracy\n"
        "  python -m workbench accuracy /tmp/rig1 /tmp/rig2  # of two seeds, told apart by folder\n"
        f"  python -m workbench accuracy {own} --estimator ekf --estimator ukf",
    )
    add_recordings(accuracy, out="results/accuracy")
    accuracy.add_argument(
        "--estimator",
        action="append",
        default=[],
        metavar="NAME",
        help="judge this one, may be repeated (default: all)",
    )
    add_system(accuracy)
    add_pdf(accuracy)
    return accuracy
