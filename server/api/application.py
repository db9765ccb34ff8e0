"""The ASGI application: all routes behind the guard.

Not the server that speaks HTTP (uvicorn). The one rule: nothing is added to the application but here.
"""

from importlib.metadata import version

from fastapi import FastAPI

from server import ws
from server.api import access, capabilities, jobs, machines, problems, programs, system
from server.api.guard import Guard, HostRule
from server.api.services import Services


def build(services: Services) -> FastAPI:
    """Put the application together."""
    app = FastAPI(
        title="millstream",
        version=version("millstream"),
        openapi_url=None,
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
    )
    problems.install(app)
    for part in (system, access, machines, capabilities, programs, jobs, ws):
        part.install(app, services)
    settings = services.config.server
    app.add_middleware(Guard, hosts=HostRule(settings.host, settings.allowed_hosts), identify=services.tokens.identify)
    return app
