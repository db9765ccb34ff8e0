"""Everybody else in the soak: dashboards that come and go, guests with tokens of a day, guessers, uploads, hands.

They speak HTTP and WebSocket to the application itself, in simulated time. Not the jobs (soakyear.py). The one rule:
each leaves something behind that the daemon has to let go of (a token, a ticket, a session, a socket that does not
read, a control, a program, an address); every answer is looked at, and none may be a fault of the daemon.
"""

import asyncio
from random import Random
from typing import Any

import httpx

from tests.harness.asgisocket import AsgiSocket
from tests.harness.changerbench import BASE_URL, desk
from tests.harness.workshop import MACHINE

WORKSHOP = f"/api/v1/machines/{MACHINE}"
LOOKS = (
    "/api/v1/machines",
    f"{WORKSHOP}/state",
    f"{WORKSHOP}/console",
    f"{WORKSHOP}/io",
    "/api/v1/programs",
    "/api/v1/jobs",
    "/api/v1/audit",
    "/api/v1/tokens",
    "/metrics",
    "/healthz",
)
OF_A_JOB = ("", "/batches", "/events", "/report")
GUESSED = (401, 429)
MACRO = "#1=%d\nO100 repeat [5]\n#1=[#1+1]\nG1 X[#1] F6000\nO100 endrepeat\nM30\n"


class People:
    """See the head of this file. `admin`: the headers of the one who is always there."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._desk, self.app = desk()
        self.admin: dict[str, str] = {}
        self._slow: list[AsgiSocket] = []
        self.asked = 0

    async def serve(self, shop: Any) -> None:
        """Another daemon stands behind the application, which outlives them all with what it keeps."""
        self._desk.shop = shop
        if not self.admin:
            made = await shop.tokens.create("admin", "admin")
            self.admin = bearer(made["token"])

    async def leave(self) -> None:
        """All sockets are closed: the daemon goes."""
        for socket in self._slow:
            await socket.disconnect()
        self._slow.clear()

    async def day(self, job: int) -> None:
        """What they do beside the jobs."""
        await self._look(job)
        await self._guest()
        await self._guess()
        await self._browser()
        await self._programs()

    async def asks(self, method: str, path: str, *allowed: int, address: str = "127.0.0.1", **rest: Any) -> Any:
        """The answer of a request. Raises AssertionError for one that is not allowed."""
        self.asked += 1
        headers = {**self.admin, **rest.pop("headers", {})}
        transport = httpx.ASGITransport(self.app, client=(address, 50_000))
        async with httpx.AsyncClient(transport=transport, base_url=BASE_URL) as client:
            answer = await client.request(method, path, headers=headers, **rest)
        assert answer.status_code in (allowed or (200,)), f"{method} {path}: {answer.status_code} {answer.text[:500]}"
        return answer

    async def queue(self, program: str) -> None:
        """While a job runs: another one is made twice under one key, moved, cancelled."""
        body = {"program": program, "machine": MACHINE, "force": True, "hold": True}
        headers = {"Idempotency-Key": f"key {self._random.random()}"}
        made = await self.asks("POST", "/api/v1/jobs", 201, json=body, headers=headers)
        again = await self.asks("POST", "/api/v1/jobs", 200, 201, json=body, headers=headers)
        job = made.json()["id"]
        assert again.json()["id"] == job
        await self.asks("POST", f"/api/v1/jobs/{job}/move", 200, json={"position": 1})
        await self.asks("POST", f"/api/v1/jobs/{job}/cancel", 200, 202)

    async def hands(self) -> None:
        """Two people move the machine: one has the control, another takes it over and gives it back, or forgets it."""
        one, other = self._client(), self._client()
        address = self._address()
        takeover = {"takeover": True}
        await self.asks("POST", f"{WORKSHOP}/control", 200, headers=one, address=address, json=takeover)
        await self.asks("POST", f"{WORKSHOP}/control", 409, headers=other, address=address)
        await self.asks("POST", f"{WORKSHOP}/control", 200, headers=other, address=address, json=takeover)
        if self._random.random() < 0.5:
            await self.asks("DELETE", f"{WORKSHOP}/control", 204, headers=other, address=address)
        else:
            await asyncio.sleep(31.0)

    async def _look(self, job: int) -> None:
        for path in (*LOOKS, *(f"/api/v1/jobs/{job}{part}" for part in OF_A_JOB)):
            await self.asks("GET", path)

    async def _guest(self) -> None:
        """A token of today: a reader that goes, and one that stops reading and is cut when the token is revoked."""
        name = f"guest {self._random.randrange(10**6)}"
        made = (await self.asks("POST", "/api/v1/tokens", 201, json={"name": name, "role": "viewer"})).json()
        guest = bearer(made["token"])
        tickets = [(await self.asks("POST", "/api/v1/ticket", headers=guest)).json()["ticket"] for _ in range(3)]
        async with AsgiSocket(self.app, query={"ticket": tickets[0]}) as reader:
            assert (await reader.hear())["type"] == "hello"
        slow = AsgiSocket(self.app, query={"ticket": tickets[1]})
        await slow.__aenter__()
        slow.reading.clear()
        await self.asks("GET", "/api/v1/machines", headers=guest, address=self._address())
        await self.asks("DELETE", f"/api/v1/tokens/{made['id']}")
        await slow.disconnect()
        gone = AsgiSocket(self.app, query={"ticket": tickets[2]})
        async with gone:
            assert gone.status == 401, "the token behind the ticket was revoked"

    async def _guess(self) -> None:
        address = self._address()
        for _ in range(self._random.randrange(1, 4)):
            wrong = bearer(f"mill_{self._random.random()}")
            await self.asks("GET", "/api/v1/machines", *GUESSED, headers=wrong, address=address)

    async def _browser(self) -> None:
        """Signs in; signs out again only sometimes."""
        token = self.admin["authorization"].removeprefix("Bearer ")
        answer = await self.asks("POST", "/api/v1/session", json={"token": token})
        cookie = {"cookie": answer.headers["set-cookie"].partition(";")[0], "authorization": ""}
        slow = AsgiSocket(self.app, headers=cookie)
        await slow.__aenter__()
        assert slow.status is None
        self._slow.append(slow)  # a screen that is left open, and read by nobody
        slow.reading.clear()
        if len(self._slow) > 3:
            await self._slow.pop(0).disconnect()
        if self._random.random() < 0.5:
            await self.asks("DELETE", "/api/v1/session", 204, headers=cookie)

    async def _programs(self) -> None:
        """One that is none, one that is drawn and deleted, one that stays for retention."""
        await self.asks("POST", "/api/v1/programs?name=a.png", 415, 422, content=b"\x89PNG\0\0" * 100)
        await self.asks("POST", "/api/v1/programs?name=b.nc", 422, content=b"")
        for _ in range(2):
            lines = "".join(f"G1 X{self._random.randrange(900)} F600\n" for _ in range(50))
            program = (await self.upload(lines))["id"]
            await self.asks("GET", f"/api/v1/programs/{program}/check?machine={MACHINE}")
            await self.asks("GET", f"/api/v1/programs/{program}/toolpath?machine={MACHINE}")
        await self.asks("DELETE", f"/api/v1/programs/{program}", 204)

    async def upload(self, text: str) -> Any:
        """A program of that text."""
        return (await self.asks("POST", "/api/v1/programs?name=part.nc", 200, 201, content=text.encode())).json()

    def _client(self) -> dict[str, str]:
        return {"Millstream-Client": f"tablet-{self._random.randrange(10**6)}"}

    def _address(self) -> str:
        return f"10.{self._random.randrange(256)}.{self._random.randrange(256)}.{self._random.randrange(1, 255)}"


def bearer(secret: str) -> dict[str, str]:
    """As a header."""
    return {"authorization": f"Bearer {secret}"}
