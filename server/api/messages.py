"""What a client may say over the WebSocket: the messages, the role that each needs, and their documentation.

Not what is done about them (`server/api/ws.py`). The one rule: a message is judged as strictly as a request, and its
answer (`result`) carries a problem as an answer over HTTP would.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, model_validator

from server.access.auth import Role
from server.api.iomodels import Levels
from server.api.machinemodels import MAX_FEED_MM_MIN, AxisMove
from server.api.models import STRICT
from server.live.subscription import DEFAULT_RATE_HZ, TOPICS, Filter

MIN_RATE_HZ = 0.1
MAX_RATE_HZ = 100.0

MachineName = Annotated[str, Field(pattern=r"^[a-z0-9-]{1,64}$")]
Topic = Literal["state", "job", "queue", "console", "alarm", "tool", "io", "program", "log"]
Rate = Annotated[float, Field(ge=MIN_RATE_HZ, le=MAX_RATE_HZ)]


class Spoken(BaseModel):
    """What every message may carry: `id` comes back in its result."""

    model_config = STRICT
    id: Annotated[str, Field(max_length=128)] | int | None = None


class Subscribe(Spoken):
    """Change what this socket gets; what is left out stays as it is."""

    type: Literal["subscribe"]
    topics: list[Topic] | None = None
    machines: Annotated[list[MachineName], Field(max_length=100)] | None = None
    rate: Rate | None = None

    def applied_to(self, old: Filter) -> Filter:
        """The filter from now on."""
        return Filter(
            topics=old.topics if self.topics is None else frozenset(self.topics),
            machines=old.machines if self.machines is None else frozenset(self.machines),
            rate_hz=old.rate_hz if self.rate is None else self.rate,
        )


class Verb(Spoken):
    """`machine` may be left out where there is only one; an `estop` without it is for all of them."""

    type: Literal["pause", "resume", "stop", "estop"]
    machine: MachineName | None = None


class Jog(Spoken, AxisMove):
    """A relative move; with `hold` motion in this direction for as long as the message is repeated."""

    type: Literal["jog"]
    machine: MachineName | None = None
    feed: Annotated[float, Field(gt=0, le=MAX_FEED_MM_MIN)]
    hold: bool = False

    @model_validator(mode="after")
    def _goes_somewhere(self) -> "Jog":
        if not self.axes():
            raise ValueError("name at least one axis with a distance that is not 0")
        return self


class JogStop(Spoken):
    """The key of a held jog was let go."""

    type: Literal["jog_stop"]
    machine: MachineName | None = None


class Io(Spoken):
    """Levels of a tool changer's inputs. The first message of a connection makes it the changer, and has all levels;
    its end is the end of the changer. `connect` says the same in words."""

    type: Literal["io"]
    machine: MachineName | None = None
    connect: bool = False
    pins: Levels


ClientMessage = Annotated[Subscribe | Verb | Jog | JogStop | Io, Field(discriminator="type")]
CLIENT_MESSAGE: TypeAdapter[Subscribe | Verb | Jog | JogStop | Io] = TypeAdapter(ClientMessage)

ROLES: dict[type[Spoken], Role] = {
    Subscribe: Role.VIEWER,
    Verb: Role.OPERATOR,
    Jog: Role.OPERATOR,
    JogStop: Role.OPERATOR,
    Io: Role.OPERATOR,
}


class SocketQuery(BaseModel):
    """The query of the address: `topics=state,job`, `machines=router`, `rate=20`, `since=1841`."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    topics: list[Topic] | None = None
    machines: list[MachineName] | None = None
    rate: Rate = DEFAULT_RATE_HZ
    since: Annotated[int, Field(ge=0)] | None = None
    client: str | None = None
    """As the header Millstream-Client (server/api/control.py)."""

    @model_validator(mode="before")
    @classmethod
    def _lists(cls, query: dict[str, Any]) -> dict[str, Any]:
        return {
            key: [item for item in value.split(",") if item] if key in ("topics", "machines") else value
            for key, value in query.items()
        }

    def filter(self) -> Filter:
        """What this socket wants at first."""
        topics = frozenset(TOPICS if self.topics is None else self.topics)
        return Filter(topics=topics, machines=frozenset(self.machines or ()), rate_hz=self.rate)


SOCKET_TEXT = """\
## WebSocket `/api/v1/events`

Needs the role `viewer` (a bearer token, or the session cookie). Query: `topics=state,job`, `machines=router`,
`rate=20` (most state messages a second), `since=SEQ` (the largest `seq` seen before a reconnect), `client=ID` (as the
header `Millstream-Client`: tells those apart who share a token), `ticket=` (of `POST /api/v1/ticket`, in the place of a
token).

Every message of the server is `{"seq", "type", "machine", "at", "data"}`. The first is `hello`; its `data` holds
`machines`, `jobs` and `queues` (by machine) as they are now, and `resync`: false when everything since `since` follows,
true when that is not known any more, so that only the snapshot counts; `problem` says why jobs could not be listed.
Then `state`, `job`, `queue`, `console`, `alarm`, `tool`, `io`, `program` and `log`.
State is coalesced: always the newest, at most `rate` a second. Console lines are left out for a
slow reader. Everything else is never left out: a reader that does not take it is disconnected (1013) and can come
back with `since`.

The client may send, and gets `{"type": "result", "id", "ok"}` for each; refused: `ok` is false, `error` the problem:

| message | role | what |
| --- | --- | --- |
| `{"type": "subscribe", "topics": [...], "machines": [...], "rate": 5}` | viewer | change what comes |
| `{"type": "pause", "machine": "router"}`, `resume`, `stop` | operator | as the addresses of the same name |
| `{"type": "estop"}` | operator | with `machine` for that one, without for all; never queued behind anything |
| `{"type": "jog", "machine": "router", "x": 1, "feed": 600}` | operator | move by 1 mm |
| `{"type": "jog", "machine": "router", "x": 1, "feed": 600, "hold": true}` | operator | move in this direction while \
the message is repeated at least every 200 ms (better every 100 ms); the distances give the direction only |
| `{"type": "jog_stop", "machine": "router"}` | operator | end a held jog at once |
| `{"type": "io", "machine": "router", "pins": {"tool-changed": true}}` | operator | inputs of the tool changer; the \
first such message of a connection has all of them and makes it the changer, until the connection ends |
"""
