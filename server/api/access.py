"""Routes of access: signing in and out, and the tokens.

Not the tokens themselves (`server/access/tokens.py`), not the audit (audit.py). The one rule: a secret is answered
once, when it is made, and is in no log and no list.
"""

from typing import Annotated

from fastapi import FastAPI, Path, Request
from starlette.datastructures import Headers
from starlette.responses import Response

from server.access.auth import SESSION_LIFETIME_S, Principal, Role
from server.access.tickets import LIFETIME_S
from server.access.tokens import TokenError
from server.api.accessmodels import NewTokenView, SessionRequest, SessionView, TicketView, TokenRequest, TokenView
from server.api.clientaddress import ADDRESS_KEY, TLS_KEY
from server.api.guard import ATTEMPT_KEY, MADE_KEY, PRINCIPAL_KEY, SESSION_COOKIE, session_cookie
from server.api.routing import Routes, json_response, principal_of
from server.api.services import Json, Services
from server.problems import ProblemError

TokenId = Annotated[str, Path(pattern=r"^[0-9a-zA-Z_-]{1,64}$", description="The token's id", examples=["9f2c41aa"])]


def install(app: FastAPI, services: Services) -> None:
    """The routes /session, /ticket and /tokens."""
    _session(app, services)
    _ticket(app, services)
    _tokens(app, services)


def _session(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "access")

    def view(principal: Principal) -> Json:
        return {"name": principal.name, "role": principal.role.word, "open": services.tokens.open}

    @routes.add("GET", "/session", role=Role.PUBLIC, summary="Who am I here", model=SessionView)
    async def get_session(request: Request) -> Response:
        """`public` means that a token is needed for everything else."""
        return json_response(view(principal_of(request)))

    @routes.add(
        "POST",
        "/session",
        role=Role.PUBLIC,
        summary="Sign in with a token",
        model=SessionView,
        errors=("unauthorized", "token_expired", "too_many_attempts"),
    )
    async def sign_in(request: Request, body: SessionRequest) -> Response:
        """For browsers: sets a cookie (HttpOnly, SameSite=Strict) that stands for the token. After ten wrong tokens
        from one address the next ones are refused unseen for a while; `Retry-After` says how long."""
        request.scope[ATTEMPT_KEY] = True
        signed_in = await services.tokens.sign_in(body.token, request.scope[ADDRESS_KEY])
        if signed_in is None:
            raise ProblemError(
                "unauthorized", "This token is not known or was revoked. `millstream token create` makes a new one."
            )
        principal, cookie = signed_in
        request.scope[PRINCIPAL_KEY] = principal  # for the audit
        response = json_response(view(principal))
        response.set_cookie(
            SESSION_COOKIE,
            cookie,
            max_age=int(SESSION_LIFETIME_S),
            httponly=True,
            samesite="strict",
            secure=request.scope[TLS_KEY],
        )
        return response

    @routes.add("DELETE", "/session", role=Role.PUBLIC, summary="Sign out", status=204)
    async def sign_out(request: Request) -> Response:
        """Ends the session of the cookie; harmless without one."""
        cookie = session_cookie(Headers(scope=request.scope))
        if cookie is not None:
            services.tokens.sign_out(cookie)
        response = Response(status_code=204)
        response.delete_cookie(SESSION_COOKIE, secure=request.scope[TLS_KEY], httponly=True, samesite="strict")
        return response


def _ticket(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "access")

    @routes.add("POST", "/ticket", role=Role.VIEWER, summary="Get a ticket for one WebSocket", model=TicketView)
    async def get_ticket(request: Request) -> Response:
        """For clients that can set neither a header nor a cookie: `/api/v1/events?ticket=…`, once, in 30 seconds."""
        ticket = services.tokens.ticket(principal_of(request))
        return json_response({"ticket": ticket, "expires_in_s": LIFETIME_S})


def _tokens(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "access")

    @routes.add("GET", "/tokens", role=Role.ADMIN, summary="List the tokens", model=list[TokenView])
    async def list_tokens() -> Response:
        return json_response(await services.tokens.list())

    @routes.add("POST", "/tokens", role=Role.ADMIN, summary="Make a token", model=NewTokenView, status=201)
    async def create_token(request: Request, body: TokenRequest) -> Response:
        """`token` is the secret; it is shown this once and cannot be read again. Sessions end with their token."""
        try:
            made = await services.tokens.create(body.name, body.role, body.expires)
        except TokenError as error:
            raise ProblemError("invalid_request", f"{error}.") from error
        request.scope[MADE_KEY] = ("target", made["id"])
        return json_response(made, 201)

    @routes.add(
        "DELETE",
        "/tokens/{id}",
        role=Role.ADMIN,
        summary="Revoke a token",
        model=TokenView,
        errors=("unknown_token",),
    )
    async def revoke_token(id: TokenId) -> Response:
        """Its sessions end with it; its row stays in the list."""
        token = await services.tokens.revoke(id)
        if token is None:
            raise ProblemError("unknown_token", f"There is no token {id!r}; GET /api/v1/tokens lists them.")
        return json_response(token)
