"""JSON Schema of all files that the workbench reads and writes; see docs/formats.md."""

from workbench.schemas.files import case_schema, gains_schema, system_schema
from workbench.schemas.summaries import summaries

__all__ = ["case_schema", "gains_schema", "summaries", "system_schema"]
