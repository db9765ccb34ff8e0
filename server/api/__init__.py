"""HTTP and WebSocket: requests in, JSON and problems out. No decision about a machine or a job is made in here.

`create_app` is all that the rest of the daemon sees of it.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fastapi import FastAPI

    from server.api.services import Services


def create_app(workshop: "Services") -> "FastAPI":
    """The ASGI application for a workshop; starting and stopping the workshop is not its business."""
    from server.api.application import build

    return build(workshop)
