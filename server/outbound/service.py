"""The ways out as one thing: prepared before any machine is touched, run beside the machines, ended with the daemon.

Not what any of them says. The one rule: what can be wrong with a way out (a port that is taken, an extra that is not
installed, a password that cannot be read) ends the start with a sentence; later it is a line of the log.
"""

import asyncio
import contextlib
import logging
import os
import socket
import ssl
from collections.abc import AsyncIterator, Coroutine, Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING

from server.clock import WallClock, stamp
from server.config.model import Config
from server.outbound import webhook
from server.outbound.announcement import Announcement, announcements, reachable
from server.outbound.devicemodel import axes_of
from server.outbound.errors import OutboundError, first_line, need
from server.outbound.feed import Feed, standing
from server.outbound.mtconnect import Adapter, fresh_devices
from server.outbound.tasks import end
from server.outbound.webhook import FileStore, Hook, HttpPost

if TYPE_CHECKING:
    from server.app import Workshop
    from server.machine.controller import Controller

log = logging.getLogger(__name__)

LINK_SEEN_HZ = 1.0
"""Webhooks are told of links, not of states: one that breaks for less than a second may go unnoticed."""


class Outbound:
    """See the head of this file. Made by `prepare`; run it at most once."""

    def __init__(self, config: Config) -> None:
        self.config = config
        self._agents: socket.socket | None = None
        self._password: str | None = None
        self._secrets: list[str | None] = []
        self._tls: ssl.SSLContext | None = None

    @classmethod
    def prepare(cls, config: Config) -> "Outbound":
        """Everything that can fail. Raises OutboundError."""
        made = cls(config)
        if config.mtconnect.enabled:
            made._agents = _listener(config.mtconnect.host, config.mtconnect.port)
        try:
            made._prepare_mqtt()
            if config.mdns.enabled:
                need("mdns", "zeroconf")
            made._secrets = [
                hook.secret or first_line(f"webhook[{index}].secret_file", hook.secret_file)
                for index, hook in enumerate(config.webhook)
            ]
        except BaseException:
            made.close()
            raise
        return made

    def close(self) -> None:
        """What was prepared and never run."""
        if self._agents is not None:
            self._agents.close()

    @contextlib.asynccontextmanager
    async def running(self, workshop: "Workshop", listening: socket.socket) -> AsyncIterator[None]:
        """Tell others, until the end of the block. `listening` is where the daemon itself is reached."""
        address: tuple[str, int] = listening.getsockname()[:2]
        tasks = [asyncio.create_task(_watched(name, work)) for name, work in self._work(workshop, *address)]
        try:
            yield
        finally:
            await end(tasks)
            self.close()

    def _work(self, workshop: "Workshop", host: str, port: int) -> list[tuple[str, Coroutine[None, None, None]]]:
        work = []
        if self._agents is not None:
            work.append(("MTConnect", self._mtconnect(workshop, self._agents)))
        if self.config.mqtt.enabled:
            work.append(("MQTT", self._mqtt(workshop)))
        if self.config.webhook:
            work.append(("The webhooks", self._webhooks(workshop)))
        if self.config.mdns.enabled:
            work.append(("mDNS", self._mdns(workshop, host, port)))
        return work

    def _feed(self, workshop: "Workshop", rate_hz: float) -> Feed:
        """`rate_hz` for each machine."""
        most_hz = rate_hz * max(1, len(workshop.machines))
        return Feed(workshop.hub, rate_hz=most_hz, now_stands=lambda: standing(workshop.machines, _now))

    def _prepare_mqtt(self) -> None:
        config = self.config.mqtt
        if not config.enabled:
            return
        need("mqtt", "aiomqtt")
        from server.outbound.mqtt import tls_context

        self._password = config.password or first_line("mqtt.password_file", config.password_file)
        try:
            self._tls = tls_context(config)
        except OSError as error:
            raise OutboundError(f"mqtt.ca_file: {config.ca_file}: {error.strerror or error}") from error

    async def _mqtt(self, workshop: "Workshop") -> None:
        from server.outbound.mqtt import Bridge
        from server.outbound.mqttaudit import asked_by_broker

        config = self.config.mqtt
        bridge = Bridge(
            config,
            workshop.machines,
            protocols={machine.name: machine.protocol for machine in self.config.machine},
            password=self._password,
            tls=self._tls,
            counted=workshop.outbound.mqtt,
            audited=lambda name, word, refused: workshop.audit.note(asked_by_broker(config, name, word, refused)),
        )
        await bridge.run(self._feed(workshop, config.rate))

    async def _webhooks(self, workshop: "Workshop") -> None:
        folder = self.config.server.data_dir / "webhooks"
        # The client would log each address at the level of what is worth knowing, and an address may be a secret.
        logging.getLogger("httpx").setLevel(logging.WARNING)
        posts = [HttpPost(config.url, config.timeout) for config in self.config.webhook]
        hooks = [
            Hook(
                config,
                secret=secret,
                post=post,
                store=FileStore(folder, config.url),
                clock=WallClock(),
                counted=workshop.outbound.webhook,
            )
            for config, secret, post in zip(self.config.webhook, self._secrets, posts, strict=True)
        ]
        try:
            await webhook.run(hooks, self._feed(workshop, LINK_SEEN_HZ))
        finally:
            for post in posts:
                await post.close()

    async def _mdns(self, workshop: "Workshop", host: str, port: int) -> None:
        from server.outbound.mdns import announcer

        def wanted(own: Sequence[str]) -> list[Announcement]:
            return announcements(
                name=self.config.mdns.name,
                hostname=socket.gethostname(),
                port=port,
                addresses=reachable(host, own),
                version=version("millstream"),
                machines=[machine.name for machine in self.config.machine],
            )

        await announcer(wanted, workshop.outbound.mdns).run()

    async def _mtconnect(self, workshop: "Workshop", listener: socket.socket) -> None:
        config = self.config.mtconnect
        machines = workshop.machines
        adapter = Adapter(
            fresh_devices((machine.name, axes_of(machine)) for machine in self.config.machine),
            counted=workshop.outbound.mtconnect,
            emergency=lambda name: _emergency(machines[name]),
            now=_now,
            max_clients=config.max_clients,
        )
        await adapter.run(listener, self._feed(workshop, config.rate))


async def _watched(name: str, work: Coroutine[None, None, None]) -> None:
    """A bug in a way out is told and ends that way; the machines go on."""
    try:
        await work
    except Exception:
        log.exception("%s has ended; the machines are not concerned. Please report this.", name)


def _emergency(machine: "Controller") -> bool:
    """An emergency stop is pressed, or was demanded here and is not confirmed yet."""
    alarm = machine.state.alarm
    return machine.unheard_stop is not None or (alarm is not None and alarm.emergency)


def _now() -> str:
    return stamp(WallClock())


def _listener(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host.strip("[]"), port), family=family)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise OutboundError(
            f"mtconnect: {host}:{port}: {reason}. Is another adapter there? Set mtconnect.host and mtconnect.port."
        ) from error
