"""The shapes of requests and answers about who may do what: sessions, tokens, the audit.

Not their meaning (server/access/tokens.py, server/access/audit.py). The one rule: a secret stands in one answer, that
of its making.
"""

from typing import Annotated, Literal

from pydantic import BaseModel, Field

from server.api.machinemodels import HolderView
from server.api.models import TIME, example, request_example

EXAMPLE_SECRET = "mill_pWz0…"  # noqa: S105 - nobody's
MAX_LIFETIME_CHARS = 16


class SessionRequest(BaseModel):
    """Sign in with a token."""

    model_config = request_example(token=EXAMPLE_SECRET)
    token: Annotated[str, Field(min_length=1, max_length=512)]


class SessionView(BaseModel):
    """Who you are here. `open`: the daemon runs without tokens, on loopback."""

    model_config = example(name="screen", role="operator", open=False)
    name: str
    role: Literal["public", "viewer", "operator", "admin"]
    open: bool


RoleWord = Literal["viewer", "operator", "admin"]


class TokenRequest(BaseModel):
    """A name for people and a role. `expires`: after how long it ends, as a number and one of m, h, d, w (`90d`);
    without it never."""

    model_config = request_example(name="screen at the mill", role="operator", expires="90d")
    name: Annotated[str, Field(min_length=1, max_length=80)]
    role: RoleWord
    expires: Annotated[str, Field(min_length=2, max_length=MAX_LIFETIME_CHARS)] | None = None


class TokenView(BaseModel):
    """A token without its secret. `last_used_at` is right to the minute."""

    model_config = example(
        id="9f2c41aa",
        name="screen",
        role="operator",
        created_at=TIME,
        last_used_at=None,
        revoked_at=None,
        expires_at=None,
    )
    id: str
    name: str
    role: RoleWord
    created_at: str
    last_used_at: str | None
    revoked_at: str | None
    expires_at: str | None


class NewTokenView(TokenView):
    """A token with its secret, which is shown this once."""

    model_config = example(
        id="9f2c41aa",
        name="screen",
        role="operator",
        created_at=TIME,
        last_used_at=None,
        revoked_at=None,
        expires_at=TIME,
        token=EXAMPLE_SECRET,
    )
    token: str


class AuditView(BaseModel):
    """A request that changed something, or was refused. `route` is the pattern of the address, or the `type` of a
    message (`method` WS), or the word that came by MQTT; `target` is the id of a program, a token or a backup. `status`
    and `code` are those of the answer. `lost`: so many rows before this one were not kept, because the disk could not
    be written."""

    model_config = example(
        id=4711,
        at=TIME,
        via="session",
        token="9f2c41aa",  # noqa: S106 - an id
        name="screen",
        address="192.168.1.17",
        method="POST",
        route="/api/v1/machines/{m}/home",
        machine="router",
        job=None,
        target=None,
        status=202,
        code=None,
        lost=0,
        hash="9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
    )
    id: int
    at: str
    via: str
    token: str | None
    name: str
    address: str
    method: str
    route: str
    machine: str | None
    job: int | None
    target: str | None
    status: int
    code: str | None
    lost: int
    hash: str


class ControlRequest(BaseModel):
    """`takeover`: also from somebody who has it."""

    model_config = request_example(takeover=True)
    takeover: bool = False


class ControlView(BaseModel):
    """Who moves a machine by hand; `yours`: it is the client that asks."""

    model_config = example(
        machine="router", holder={"name": "screen", "client": "192.168.1.17", "since": TIME}, yours=False
    )
    machine: str
    holder: HolderView | None
    yours: bool


class TicketView(BaseModel):
    """A ticket for one WebSocket; good once, for so many seconds."""

    model_config = example(ticket="tPw0…", expires_in_s=30.0)
    ticket: str
    expires_in_s: float
