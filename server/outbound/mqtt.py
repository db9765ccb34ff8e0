"""The connection to a broker (extra `mqtt`: aiomqtt): held, and taken up again after any break, with back-off.

Not what is told (mqtttopics.py) nor what waits (mqttoutbox.py). The one rule: whatever the broker does, what happens in
the workshop is taken from the hub in its time; a broker that hangs is one that is away.
"""

import asyncio
import logging
import ssl
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from importlib.metadata import version
from typing import Protocol

import aiomqtt

from server.config.telemetry import MqttConfig
from server.outbound.feed import Feed
from server.outbound.mqttoutbox import Outbox
from server.outbound.mqtttopics import OFFLINE, ONLINE, Post, Teller, Topics, discovery
from server.outbound.tasks import end
from server.problems import ProblemError
from server.waysout import WayOut

log = logging.getLogger(__name__)

ANSWER_WITHIN_S = 10.0
"""For the connection, and for the acknowledgement of each message."""
FAREWELL_S = 1.0
FIRST_WAIT_S, LONGEST_WAIT_S = 1.0, 60.0
QOS = 1
"""At least once: an alarm that was lost on the way is worse than one that is told twice."""
COMMANDS_WAITING = 16


class Obeys(Protocol):
    """A machine, as far as a broker may ask something of it (`server.machine.controller.Controller`)."""

    def pause(self) -> None: ...
    def stop(self) -> None: ...
    def estop(self) -> None: ...


VERBS: Mapping[str, Callable[[Obeys], None]] = {
    "pause": lambda machine: machine.pause(),
    "stop": lambda machine: machine.stop(),
    "estop": lambda machine: machine.estop(),
}
Audited = Callable[[str, str, ProblemError | None], None]
"""Told of each command that came: the machine, the word, and why it was refused."""


class Bridge:
    """See the head of this file. `protocols`: of each machine, by name; `password` None: none is sent."""

    def __init__(
        self,
        config: MqttConfig,
        machines: Mapping[str, Obeys],
        *,
        protocols: Mapping[str, str],
        password: str | None,
        tls: ssl.SSLContext | None,
        counted: WayOut,
        audited: Audited,
    ) -> None:
        self._config = config
        self._machines = machines
        self._protocols = protocols
        self._password = password
        self._tls = tls
        self._counted = counted
        self._audited = audited
        self._topics = Topics(config.prefix)
        self._teller = Teller(self._topics)
        self._outbox = Outbox(config.queue_limit, counted)
        self._standing: dict[str, Post] = {}
        """The newest of each topic: what a broker that has forgotten everything is told."""
        self._something = asyncio.Event()
        self._wait_s = FIRST_WAIT_S
        self._complaint = ""

    async def run(self, feed: Feed) -> None:
        """Until it is cancelled."""
        connecting = asyncio.create_task(self._stay_connected())
        try:
            async for notice in feed:
                for post in self._teller.posts(notice):
                    self._standing[post.topic] = post
                    self._outbox.put(post)
                    self._something.set()
        finally:
            await end([connecting])

    # --- the connection ---------------------------------------------------------------------------------------

    async def _stay_connected(self) -> None:
        while True:
            try:
                async with self._client() as client:
                    await self._connected(client)
            except (aiomqtt.MqttError, OSError, ValueError) as error:
                self._complain(str(error) or type(error).__name__)
            finally:
                self._counted.connected = 0
            self._counted.failures += 1
            await asyncio.sleep(self._wait_s)
            self._wait_s = min(2 * self._wait_s, LONGEST_WAIT_S)

    def _client(self) -> aiomqtt.Client:
        config = self._config
        return aiomqtt.Client(
            config.host,
            config.port,
            username=config.username,
            password=self._password,
            will=aiomqtt.Will(self._topics.availability, OFFLINE, qos=QOS, retain=True),
            tls_context=self._tls,
            keepalive=config.keepalive,
            timeout=ANSWER_WITHIN_S,
            max_queued_incoming_messages=COMMANDS_WAITING,
        )

    async def _connected(self, client: aiomqtt.Client) -> None:
        log.info("MQTT: connected to %s:%d", self._config.host, self._config.port)
        self._complaint = ""
        self._counted.connected = 1
        work = [asyncio.create_task(self._send(client)), asyncio.create_task(self._obey(client))]
        try:
            done, _ = await asyncio.wait(work, return_when=asyncio.FIRST_EXCEPTION)
            for task in done:
                task.result()
        except asyncio.CancelledError:
            # The daemon ends in good order: the broker says no last will then, so we say it.
            with suppress(aiomqtt.MqttError):
                await client.publish(self._topics.availability, OFFLINE, qos=QOS, retain=True, timeout=FAREWELL_S)
            raise
        finally:
            await end(work)

    async def _send(self, client: aiomqtt.Client) -> None:
        """What a broker has to know first, then what waits, for ever."""
        for greeting in self._greeting():
            await self._publish(client, greeting)
        self._wait_s = FIRST_WAIT_S
        for told in self._standing.values():
            self._outbox.give_back(replace(told, kept=False))
        while True:
            self._something.clear()
            while (post := self._outbox.take()) is not None:
                try:
                    await self._publish(client, post)
                except BaseException:
                    self._outbox.give_back(post)
                    raise
            await self._something.wait()

    def _greeting(self) -> list[Post]:
        config = self._config
        posts: list[Post] = []
        if config.discovery:
            for name, protocol in self._protocols.items():
                posts += discovery(
                    self._topics,
                    name,
                    protocol,
                    prefix=config.discovery_prefix,
                    version=version("millstream"),
                    commands=config.allow_commands,
                )
        return [*posts, Post(self._topics.availability, ONLINE)]

    async def _publish(self, client: aiomqtt.Client, post: Post) -> None:
        await client.publish(post.topic, post.payload, qos=QOS, retain=True)
        self._counted.sent += 1

    def _complain(self, reason: str) -> None:
        """Once for each reason: a broker may be away for a night."""
        if reason != self._complaint:
            self._complaint = reason
            log.warning("MQTT: %s:%d: %s. Trying again.", self._config.host, self._config.port, reason)

    # --- commands ---------------------------------------------------------------------------------------------

    async def _obey(self, client: aiomqtt.Client) -> None:
        if self._config.allow_commands:
            for name in self._machines:
                await client.subscribe(self._topics.of(name, "command"), qos=QOS)
        async for message in client.messages:
            if message.retain:
                # Whoever asked for it did so at another time, before anybody knew in which state the machine is now.
                log.warning("MQTT: a retained message at %s is not obeyed", message.topic.value[:100])
                continue
            command = self._topics.command(message.topic.value, message.payload, tuple(self._machines))
            if command is None or not self._config.allow_commands:
                log.warning("MQTT: a message at %s is no command", message.topic.value[:100])
                continue
            self._do(*command)

    def _do(self, name: str, word: str) -> None:
        refused: ProblemError | None = None
        try:
            VERBS[word](self._machines[name])
            log.info("MQTT: %s of %s was asked for", word, name)
        except ProblemError as problem:
            refused = problem
            log.warning("MQTT: %s of %s was asked for: %s", word, name, problem)
        self._audited(name, word, refused)


def tls_context(config: MqttConfig) -> ssl.SSLContext | None:
    """What the broker is verified with. Raises OSError, of which ssl.SSLError is one."""
    if not config.tls:
        return None
    return ssl.create_default_context(cafile=None if config.ca_file is None else str(config.ca_file))
