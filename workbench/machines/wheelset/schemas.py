"""JSON Schema of what this machine's own commands write."""

from workbench.cli.schemas import (
    ERROR,
    FLAG,
    FMU,
    NUMBER,
    RUN,
    TEXT,
    Schema,
    by_name,
    closed,
    listed,
    summary,
)


def _accuracy() -> Schema:
    result = {"type": "object", "additionalProperties": {"type": ["number", "null", "string"]}}
    result["properties"] = {"failure": TEXT, "covers": by_name(NUMBER)}
    stop = {
        "title": TEXT,
        "wet_discs": FLAG,
        "slides": FLAG,
        "estimators": by_name(result),
    }
    worst = closed({"quantity": TEXT, "value": ERROR, "stop": TEXT})
    entries = {
        "quantities": by_name(closed({"unit": TEXT, "text": TEXT})),
        "stops": by_name(closed(stop)),
        "worst": by_name(by_name(worst)),
        "bands": by_name(by_name(NUMBER)),
    }
    provenance = {"run": RUN, "workbench": TEXT, "packages": by_name(TEXT)}
    provenance |= {"fmus": listed(FMU), "gains": by_name(TEXT)}
    return summary("accuracy", closed(provenance), entries)


SUMMARIES = {"accuracy": _accuracy}
