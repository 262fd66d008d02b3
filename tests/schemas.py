"""Files that were written, against their published schemas."""

from typing import Any

import jsonschema

from workbench.cli.schemas import summaries


def validator(schema: dict[str, Any]) -> jsonschema.Draft202012Validator:
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def check(command: str, summary: dict[str, Any]) -> None:
    """Refuse a summary that is not as its schema says."""
    validator(summaries()[command]).validate(summary)
