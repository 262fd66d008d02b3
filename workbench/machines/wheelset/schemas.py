"""JSON Schema of what this machine's own commands write."""

from workbench.cli import schemas
from workbench.cli.schemas import FLAG, NUMBER, TEXT, Schema, by_name, closed


def _accuracy() -> Schema:
    result = {"type": "object", "additionalProperties": {"type": ["number", "null", "string"]}}
    result["properties"] = {"failure": TEXT, "covers": by_name(NUMBER)}
    stop = {"title": TEXT, "wet_discs slides": FLAG, "estimators": by_name(result)}
    worst = closed({"quantity stop": TEXT, "value": schemas.ERROR})
    entries = {
        "quantities": by_name(closed({"unit text": TEXT})),
        "stops": by_name(closed(stop)),
        "worst": by_name(by_name(worst)),
        "bands": by_name(by_name(NUMBER)),
    }
    provenance = {
        "run": schemas.RUN,
        "workbench": TEXT,
        "packages gains": by_name(TEXT),
        "fmus": schemas.listed(schemas.FMU),
    }
    return schemas.summary("accuracy", closed(provenance), entries)


SUMMARIES = {"accuracy": _accuracy}
