"""What all routes share: JSON in and out, errors as answers."""

from __future__ import annotations

import json
import logging
from typing import Any

from aiohttp import web
from aiohttp.typedefs import Handler

from hydraulic_interfaces.errors import HydraulicError, one_line
from hydraulic_workbench.calls import NoAnswerError, Said
from hydraulic_workbench.errors import WorkbenchError

LARGEST_BODY = 4 << 20
_LOG = logging.getLogger("hydraulic_workbench")


@web.middleware
async def errors(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Errors of the user's and of the bench become answers that say what is wrong."""
    try:
        return await handler(request)
    except WorkbenchError as error:
        return web.json_response({"error": str(error), "field": error.field}, status=error.status)
    except NoAnswerError as error:
        return web.json_response({"error": str(error), "field": None}, status=503)
    except (HydraulicError, OSError) as error:
        return web.json_response({"error": one_line(error), "field": None}, status=400)
    except web.HTTPException as answer:
        if answer.status < 400 or not request.path.startswith("/api/"):
            raise
        return web.json_response({"error": answer.text or answer.reason, "field": None}, status=answer.status)
    except Exception:
        _LOG.exception("%s %s", request.method, request.path)
        return web.json_response(
            {"error": "an error of the workbench itself: see its terminal", "field": None}, status=500
        )


async def asked(request: web.Request) -> dict[str, Any]:
    """The JSON object in a request's body.

    :raises WorkbenchError: there is none.
    """
    if request.content_type != "application/json":
        raise WorkbenchError("the body must be application/json")
    try:
        found = json.loads(await request.text())
    except (ValueError, RecursionError):
        raise WorkbenchError("the body is no JSON") from None
    if not isinstance(found, dict):
        raise WorkbenchError("the body must be a JSON object")
    return found


def answer(content: Any = None, status: int = 200) -> web.Response:
    """A JSON answer; NaN has no place in it."""
    body = {} if content is None else content
    return web.json_response(body, status=status, dumps=lambda value: json.dumps(value, allow_nan=False))


def said(content: Said) -> web.Response:
    """What a node answered."""
    return answer({"ok": content.ok, "message": content.message})


def number(request: web.Request, name: str, default: float | None = None) -> float | None:
    """A number of the query.

    :raises WorkbenchError: it is none.
    """
    text = request.query.get(name)
    if text is None:
        return default
    try:
        value = float(text)
    except ValueError:
        raise WorkbenchError(f"{name} is {text!r}; it must be a number", name) from None
    if not abs(value) < float("inf"):
        raise WorkbenchError(f"{name} is {text!r}; it must be finite", name)
    return value


def points(request: web.Request, default: int) -> int:
    """How many points a curve may have."""
    return int(number(request, "points", default) or default)
