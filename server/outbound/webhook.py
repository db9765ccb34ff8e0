"""Tells an address by POST, message by message, until it was heard. At least once, over restarts too.

Not what is told (webhookevents.py) nor in which order (webhookqueue.py). The one rule: a message is on the disk before
it is sent for the first time, and off it only when the address has answered 2xx or it was given up.
"""

import asyncio
import hashlib
import logging
import os
import uuid
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

import httpx

from server.clock import Clock
from server.config.telemetry import WebhookConfig
from server.outbound.feed import Feed
from server.outbound.tasks import end
from server.outbound.webhookevents import Happened, Watcher, body_of, headers_of
from server.outbound.webhookqueue import Queue, Waiting, messages_of, text_of
from server.waysout import WayOut

log = logging.getLogger(__name__)

GONE = 410
"""RFC 9110 §15.5.11: it will not come back, and who sends should stop. Every other answer may be one of a bad hour."""
MOST_FILE_BYTES = 256 * 1024 * 1024

Post = Callable[[bytes, Mapping[str, str]], Awaitable[int]]
"""Sends a body with headers; the status of the answer. Raises OSError or httpx.HTTPError."""


class Store(Protocol):
    """Where a queue outlives the daemon."""

    async def load(self) -> Sequence[Waiting]: ...
    async def save(self, messages: Sequence[Waiting]) -> None: ...


class Hook:
    """One address."""

    def __init__(
        self,
        config: WebhookConfig,
        *,
        secret: str | None,
        post: Post,
        store: Store,
        clock: Clock,
        counted: WayOut,
        new_id: Callable[[], str] = lambda: uuid.uuid4().hex,
    ) -> None:
        self._config = config
        self._secret = secret
        self._post = post
        self._store = store
        self._clock = clock
        self._new_id = new_id
        self._queue = Queue(limit=config.queue_limit, give_up_after_s=config.give_up_after, counted=counted)
        self._something = asyncio.Event()
        self._host = urlsplit(config.url).hostname or "?"
        """All of the address that is ever logged: the rest may be a secret."""
        self._complaint = ""

    def hear(self, happened: Happened) -> None:
        """Take what is wanted; never waits."""
        machines = self._config.machines
        if happened.event in self._config.events and (not machines or happened.machine in machines):
            name = self._new_id()
            self._queue.put(Waiting(name, body_of(name, happened), self._clock.now().timestamp()))
            self._something.set()

    async def run(self) -> None:
        """Until it is cancelled."""
        await self._take_up()
        try:
            await self._keep_delivering()
        finally:
            await self._write_down()

    async def _keep_delivering(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            self._something.clear()
            message = self._queue.head(self._clock.now().timestamp())
            await self._write_down()
            if message is None:
                await self._something.wait()
            elif (wait_s := self._queue.due_at - loop.time()) > 0:
                await asyncio.sleep(wait_s)
            else:
                await self._deliver(message)

    async def _deliver(self, message: Waiting) -> None:
        timestamp_s = int(self._clock.now().timestamp())
        headers = headers_of(message.id, message.body, timestamp_s=timestamp_s, secret=self._secret)
        try:
            async with asyncio.timeout(self._config.timeout):
                status = await self._post(message.body.encode(), headers)
        except TimeoutError:
            self._failed(f"no answer within {self._config.timeout:g} s")
        except (OSError, httpx.HTTPError, httpx.InvalidURL) as error:
            self._failed(str(error) or type(error).__name__)
        else:
            self._answered(message, status)

    def _answered(self, message: Waiting, status: int) -> None:
        if 200 <= status < 300:
            self._complaint = ""
            self._queue.delivered(message)
        elif status == GONE:
            log.warning("Webhook: %s answers 410, gone: message %s is dropped", self._host, message.id)
            self._queue.refused(message)
        else:
            why = ", a redirection, which is not followed" if 300 <= status < 400 else ""
            self._failed(f"it answers {status}{why}")

    def _failed(self, reason: str) -> None:
        wait_s = self._queue.failed(asyncio.get_running_loop().time())
        if reason != self._complaint:
            self._complaint = reason
            log.warning("Webhook: %s: %s. Trying again in %g s.", self._host, reason, wait_s)

    # --- over a restart ---------------------------------------------------------------------------------------

    async def _take_up(self) -> None:
        try:
            self._queue.restore(await self._store.load())
        except (OSError, ValueError) as error:
            log.warning("Webhook: what waited for %s in the daemon before is lost: %s", self._host, error)

    async def _write_down(self) -> None:
        if self._queue.changed:
            self._queue.changed = False
            try:
                await self._store.save(self._queue.snapshot())
            except OSError as error:  # a full disk: it is sent all the same, and is lost only if the daemon ends too
                log.warning("Webhook: what waits for %s cannot be written down: %s", self._host, error)


async def run(hooks: Sequence[Hook], feed: Feed) -> None:
    """All addresses, until it is cancelled."""
    tasks = [asyncio.create_task(hook.run()) for hook in hooks]
    watcher = Watcher()
    try:
        async for notice in feed:
            for happened in watcher.events(notice):
                for hook in hooks:
                    hook.hear(happened)
    finally:
        await end(tasks)


class FileStore:
    """A file of its own for each address, replaced as a whole, in a thread. The address is not in it."""

    def __init__(self, folder: Path, url: str) -> None:
        self._path = folder / f"{hashlib.sha256(url.encode()).hexdigest()[:32]}.json"

    async def load(self) -> Sequence[Waiting]:
        return await asyncio.to_thread(self._read)

    async def save(self, messages: Sequence[Waiting]) -> None:
        await asyncio.to_thread(self._replace, messages)

    def _read(self) -> Sequence[Waiting]:
        with suppress(FileNotFoundError):
            if self._path.stat().st_size > MOST_FILE_BYTES:
                raise ValueError("the file is too large")
            return messages_of(self._path.read_text(encoding="utf-8"))
        return ()

    def _replace(self, messages: Sequence[Waiting]) -> None:
        self._path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        new = self._path.with_suffix(".new")
        with new.open("w", encoding="utf-8") as file:
            file.write(text_of(messages))
            file.flush()
            os.fsync(file.fileno())
        new.replace(self._path)


class HttpPost:
    """POST over HTTP: no redirection is followed, no answer is read. The client is made in a thread: that reads every
    certificate of the system."""

    def __init__(self, url: str, timeout_s: float) -> None:
        self._url = url
        self._timeout_s = timeout_s
        self._client: httpx.AsyncClient | None = None

    async def __call__(self, body: bytes, headers: Mapping[str, str]) -> int:
        if self._client is None:
            self._client = await asyncio.to_thread(self._made)
        request = self._client.build_request("POST", self._url, content=body, headers=dict(headers))
        response = await self._client.send(request, stream=True)
        await response.aclose()
        return response.status_code

    def _made(self) -> httpx.AsyncClient:
        return httpx.AsyncClient(timeout=self._timeout_s, follow_redirects=False)

    async def close(self) -> None:
        """Give the connections back."""
        if self._client is not None:
            await self._client.aclose()
