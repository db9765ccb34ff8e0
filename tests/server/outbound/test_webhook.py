"""The sending in simulated time, with an address that fails, hangs, comes back; and once over HTTP and a real file."""

import asyncio
import json
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.config.telemetry import WebhookConfig
from server.live.hub import Hub
from server.outbound import webhook
from server.outbound.feed import Feed, Notice
from server.outbound.tasks import end
from server.outbound.webhook import FileStore, Hook, HttpPost
from server.outbound.webhookevents import Happened
from server.outbound.webhookqueue import Waiting
from server.waysout import WayOut
from tests.harness.simloop import LoopClock, run_simulated
from tests.server.outbound.test_shdr import AT, JOB

FAILED = Happened("job.failed", "router", AT, {"job": {"id": 7}})


class Memory:
    """A disk. `broken`: it takes nothing."""

    def __init__(self) -> None:
        self.held: tuple[Waiting, ...] = ()
        self.broken = False

    async def load(self) -> Sequence[Waiting]:
        if self.broken:
            raise ValueError("not a list")
        return self.held

    async def save(self, messages: Sequence[Waiting]) -> None:
        if self.broken:
            raise OSError(28, "No space left on device")
        self.held = tuple(messages)


class Address:
    """Answers with what it is told to, 200 at the end; an exception is raised, None never answers."""

    def __init__(self, *answers: int | Exception | None) -> None:
        self.answers = list(answers)
        self.heard: list[tuple[float, str, Mapping[str, str]]] = []
        self.on_disk: list[int] = []
        self.store: Memory | None = None

    async def __call__(self, body: bytes, headers: Mapping[str, str]) -> int:
        self.heard.append((asyncio.get_running_loop().time(), json.loads(body)["id"], headers))
        if self.store is not None:
            self.on_disk.append(len(self.store.held))
        answer = self.answers.pop(0) if self.answers else 200
        if answer is None:
            await asyncio.sleep(1e6)
        if isinstance(answer, Exception):
            raise answer
        assert answer is not None
        return answer


class Bench:
    def __init__(self, address: Address, store: Memory | None = None, **config: Any) -> None:
        self.address, self.store, self.counted = address, store or Memory(), WayOut()
        address.store = self.store
        self.names = iter(range(10_000))
        self.hook = Hook(
            WebhookConfig(url="https://shop.example/hook?key=s3cr3t", **config),
            secret="key",
            post=address,
            store=self.store,
            clock=LoopClock(asyncio.get_running_loop()),
            counted=self.counted,
            new_id=lambda: f"id{next(self.names)}",
        )
        self.task = asyncio.create_task(self.hook.run())


def test_a_message_is_on_the_disk_before_it_is_sent_and_off_it_afterwards() -> None:
    async def main() -> None:
        bench = Bench(address := Address())
        await asyncio.sleep(1)
        bench.hook.hear(FAILED)
        await asyncio.sleep(1)
        assert address.on_disk == [1]
        assert bench.store.held == ()
        ((_, name, headers),) = address.heard
        assert name == headers["X-Millstream-Id"] == "id0"
        assert headers["X-Millstream-Signature"].startswith("sha256=")
        assert (bench.counted.sent, bench.counted.waiting) == (1, 0)
        await end([bench.task])

    run_simulated(main())


def test_an_address_that_fails_is_tried_again_with_the_same_id_and_a_new_time(caplog: pytest.LogCaptureFixture) -> None:
    async def main() -> None:
        bench = Bench(address := Address(500, httpx.ConnectError("no route"), None, 302, 404))
        bench.hook.hear(FAILED)
        bench.hook.hear(FAILED)
        await asyncio.sleep(100)
        assert [name for _, name, _ in address.heard] == ["id0"] * 6 + ["id1"]
        begun = [at for at, _, _ in address.heard]
        assert begun == pytest.approx([0, 1, 3, 3 + 10 + 4, 25, 41, 41], abs=0.1)
        times = [int(headers["X-Millstream-Timestamp"]) for _, _, headers in address.heard]
        assert times[5] - times[0] == 41
        assert len({headers["X-Millstream-Signature"] for _, _, headers in address.heard}) == 7
        assert (bench.counted.failures, bench.counted.sent) == (5, 2)
        await end([bench.task])

    run_simulated(main())
    assert "no answer within 10 s" in caplog.text
    assert "302, a redirection, which is not followed" in caplog.text
    assert "s3cr3t" not in caplog.text


def test_an_address_that_is_gone_is_not_asked_again_and_an_old_message_is_given_up() -> None:
    async def main() -> None:
        bench = Bench(address := Address(410, *[503] * 500), give_up_after=60.0)
        bench.hook.hear(FAILED)
        await asyncio.sleep(1)
        assert (len(address.heard), bench.counted.dropped, bench.store.held) == (1, 1, ())
        bench.hook.hear(FAILED)
        await asyncio.sleep(200)
        assert len(address.heard) == 1 + 6, "at 0, 1, 3, 7, 15 and 31 s"
        assert (bench.counted.dropped, bench.counted.waiting, bench.store.held) == (2, 0, ())
        await end([bench.task])

    run_simulated(main())


def test_what_was_not_heard_goes_on_after_a_restart_under_its_id() -> None:
    async def main() -> None:
        bench = Bench(Address(*[503] * 10))
        bench.hook.hear(FAILED)
        await asyncio.sleep(2)
        bench.hook.hear(FAILED)  # the daemon ends before it was written down
        await end([bench.task])
        again = Bench(address := Address(), bench.store)
        await asyncio.sleep(1)
        assert [name for _, name, _ in address.heard] == ["id0", "id1"]
        assert again.store.held == ()
        await end([again.task])

    run_simulated(main())


def test_a_disk_that_takes_nothing_keeps_no_message_back(caplog: pytest.LogCaptureFixture) -> None:
    async def main() -> None:
        store = Memory()
        store.broken = True
        bench = Bench(address := Address(), store)
        bench.hook.hear(FAILED)
        await asyncio.sleep(1)
        assert len(address.heard) == 1
        await end([bench.task])

    run_simulated(main())
    assert "is lost: not a list" in caplog.text
    assert "cannot be written down" in caplog.text


def test_only_what_is_wanted_is_told() -> None:
    async def main() -> None:
        bench = Bench(address := Address(), machines=("lathe",), events=("job.failed",))
        bench.hook.hear(FAILED)
        bench.hook.hear(Happened("job.completed", "lathe", AT, {}))
        bench.hook.hear(Happened("job.failed", "lathe", AT, {}))
        await asyncio.sleep(1)
        assert len(address.heard) == 1
        await end([bench.task])

    run_simulated(main())


def test_from_the_hub_to_every_address() -> None:
    async def main() -> None:
        hub = Hub(clock=LoopClock(asyncio.get_running_loop()).now)
        good, hanging = Bench(Address()), Bench(Address(None, None, None))
        for bench in (good, hanging):
            await end([bench.task])
        feed = Feed(hub, rate_hz=1.0, now_stands=lambda: [Notice("job", "router", AT, JOB, fresh=True)])
        running = asyncio.create_task(webhook.run([good.hook, hanging.hook], feed))
        await asyncio.sleep(1)
        hub.publish("job", "router", {**JOB, "status": "failed"})
        await asyncio.sleep(1)
        assert len(good.address.heard) == len(hanging.address.heard) == 1
        await end([running])
        assert hub.readers == 0

    run_simulated(main())


@pytest.mark.real
def test_over_http_and_a_real_file(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    asked: list[bytes] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = await reader.readuntil(b"\r\n\r\n")
        size = next(int(line[15:]) for line in head.split(b"\r\n") if line.lower().startswith(b"content-length:"))
        asked.append(head + await reader.readexactly(size))
        where = b"HTTP/1.1 307 X\r\nLocation: /elsewhere\r\n" if len(asked) == 1 else b"HTTP/1.1 204 X\r\n"
        writer.write(where + b"Connection: close\r\n\r\n")
        writer.close()

    async def main() -> None:
        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        url = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}/hook"
        store, post = FileStore(tmp_path / "webhooks", url), HttpPost(url, 5.0)
        assert await store.load() == ()
        assert await post(b"{}", {"X-Millstream-Id": "a"}) == 307
        assert await post(b"{}", {"X-Millstream-Id": "a"}) == 204
        await post.close()
        await store.save([Waiting("a", "{}", 1.0)])
        assert await store.load() == [Waiting("a", "{}", 1.0)]
        server.close()
        with pytest.raises(httpx.HTTPError):
            await post.__class__(url, 5.0)(b"{}", {})

    asyncio.run(asyncio.wait_for(main(), 5))
    assert [head.split()[:2] for head in asked] == [[b"POST", b"/hook"]] * 2
    assert all(b"X-Millstream-Id: a" in head and head.endswith(b"\r\n\r\n{}") for head in asked)
    (file,) = (tmp_path / "webhooks").iterdir()
    assert "127.0.0.1" not in file.name + file.read_text()
