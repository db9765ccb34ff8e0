"""The OpenAPI document, complete and ours: no shape of a framework in it, and what it cannot express in words.

Not the routes. The one rule: what the document says is tested against the routes, so nothing is written twice.
"""

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from server.api.messages import SOCKET_TEXT
from server.api.models import Problem

DESCRIPTION = """\
millstream streams G-code to CNC controllers: every line executed exactly once, or the doubt named.

Units: mm, mm/min, rpm, s. Times are RFC 3339 in UTC. Errors are `application/problem+json` (RFC 9457) with a stable
`code`. A token goes into `Authorization: Bearer`; browsers sign in at `/api/v1/session`.
"""

FRAMEWORK_SCHEMAS = ("HTTPValidationError", "ValidationError")


def document(app: FastAPI) -> dict[str, Any]:
    """The document of an application with all routes."""
    built = get_openapi(
        title=app.title, version=app.version, description=f"{DESCRIPTION}\n{SOCKET_TEXT}", routes=app.routes
    )
    schemas = built.setdefault("components", {}).setdefault("schemas", {})
    for name in FRAMEWORK_SCHEMAS:
        schemas.pop(name, None)
    schemas["Problem"] = Problem.model_json_schema()
    _close_names(schemas)
    built["components"]["securitySchemes"] = {
        "token": {"type": "http", "scheme": "bearer"},
        "session": {"type": "apiKey", "in": "cookie", "name": "millstream_session"},
    }
    for item in built["paths"].values():
        for operation in item.values():
            _finish(operation, schemas)
    return built


def _close_names(value: Any) -> None:
    """Where names have a pattern, others are refused: pydantic does so, but what it writes lets them through."""
    if isinstance(value, dict):
        if "patternProperties" in value:
            value.setdefault("additionalProperties", False)
        for inner in value.values():
            _close_names(inner)


def _finish(operation: dict[str, Any], schemas: dict[str, Any]) -> None:
    answers = operation["responses"]
    if "content" not in answers.get("200", {"content": {}}):
        del answers["200"]  # an address that only ever refuses (capabilities.py)
    public = operation["x-required-role"] == "public"
    operation["security"] = [] if public else [{"token": []}, {"session": []}]
    for media in operation.get("requestBody", {}).get("content", {}).values():
        if "example" not in media:
            media["example"] = _example(media["schema"], schemas)


def _example(schema: dict[str, Any], schemas: dict[str, Any]) -> Any:
    """The first example of the model that a body's schema refers to (also where the body may be absent)."""
    for option in (schema, *schema.get("anyOf", ())):
        if "$ref" in option:
            return schemas[option["$ref"].rpartition("/")[2]]["examples"][0]
    raise AssertionError(f"a body without an example: {schema}")
