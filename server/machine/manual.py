"""Commands by hand: waits for the engine to be free, hands them over one by one, tells the caller what came of them.

Not the permission to do so (controller.py asks first). The one rule: whoever waits is always answered: by the
machine, or because the epoch ended, or because an emergency stop swept the queue.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

from protocol.commands import (
    Command,
    Home,
    Jog,
    ReadDescriptions,
    ReadFirmware,
    ReadModal,
    ReadOffsets,
    ReadSettings,
    ReadStartupBlocks,
    RealtimeCommand,
    RunBlock,
)
from protocol.engine import Engine
from protocol.errors import MessageTooLongError
from protocol.events import CommandDone, CommandFailed, ControllerReset, Event, MachineRestarted
from server.machine.link import Link
from server.problems import ProblemError

QUEUE_LIMIT = 4
"""Commands by hand that wait, so that a held jog does not stop between two steps. More are refused."""
QUESTIONS = (ReadDescriptions, ReadFirmware, ReadModal, ReadOffsets, ReadSettings, ReadStartupBlocks)
MAX_EVENTS = 16
"""Kept of one command: every command brings one or two; an engine that brings more must not fill memory."""

Make = Callable[[int], Command]
MakeRealtime = Callable[[int], RealtimeCommand]
E = TypeVar("E", bound=Event)


@dataclass(frozen=True, slots=True)
class Answer:
    """What came of a command: every event with its token, in order, and the one that ended it."""

    events: tuple[Event, ...]
    end: CommandDone | CommandFailed

    def only(self, kind: type[E]) -> E:
        """The event of this kind that a command which was done has brought."""
        return next(event for event in self.events if isinstance(event, kind))


@dataclass(slots=True, eq=False)
class Row:
    """Several commands of one request, one after the other. `problem`: why the rest is not sent."""

    problem: ProblemError | None = None

    def check(self) -> None:
        """Raises ProblemError."""
        if self.problem is not None:
            raise self.problem


@dataclass(slots=True)
class _Waiting:
    command: Command
    future: asyncio.Future[Answer]
    droppable: bool


@dataclass(slots=True)
class _Sent:
    command: Command | RealtimeCommand
    future: asyncio.Future[Answer]
    events: list[Event] = field(default_factory=list)


class Manual:
    """The commands by hand of one machine."""

    def __init__(self, machine: str, loop: asyncio.AbstractEventLoop) -> None:
        self._machine = machine
        self._loop = loop
        self._token = 0
        self._queue: deque[_Waiting] = deque()
        self._sent: dict[int, _Sent] = {}
        self._rows: set[Row] = set()
        self.touched = 0
        """Another number: a command that is more than a question was handed over, or the controller was reset, or the
        epoch ended. What was planned from what the machine held before may be wrong then."""

    @property
    def busy(self) -> bool:
        """Something by hand is under way."""
        return bool(self._queue or self._sent or self._rows)

    @property
    def acts(self) -> bool:
        """Something by hand is under way that is more than a question: a reader must not keep a job from beginning."""
        commands = [*(one.command for one in self._queue), *(one.command for one in self._sent.values())]
        return bool(self._rows) or any(not isinstance(command, QUESTIONS) for command in commands)

    @property
    def moves(self) -> bool:
        """Something that may move is with the machine and has no end yet, or the next of a row is about to be."""
        return bool(self._rows) or any(isinstance(one.command, RunBlock | Home | Jog) for one in self._sent.values())

    @property
    def waiting(self) -> bool:
        """Something by hand is not with the machine yet."""
        return bool(self._queue)

    def next_token(self) -> int:
        """A token that no other command has."""
        self._token += 1
        return self._token

    @contextmanager
    def row(self) -> Iterator[Row]:
        """Several commands of one request. Between two of them nothing is with the machine, but they are under way."""
        row = Row()
        self._rows.add(row)
        try:
            yield row
        finally:
            self._rows.discard(row)

    def put(self, make: Make, *, droppable: bool = False) -> asyncio.Future[Answer]:
        """Queue a command; the future is the answer. `droppable`: a jog cancel may still take it back. Who cancels the
        future while the command waits takes it back as well."""
        if len(self._queue) >= QUEUE_LIMIT:
            raise ProblemError("machine_busy", f"{self._machine} still has {len(self._queue)} commands to execute.")
        future: asyncio.Future[Answer] = self._loop.create_future()
        self._queue.append(_Waiting(make(self.next_token()), future, droppable))
        return future

    def press(self, link: Link, make: MakeRealtime) -> asyncio.Future[Answer]:
        """Hand over a command of the realtime lane at once, beside whatever waits; the future is the answer."""
        command = make(self.next_token())
        sent = self._sent[_token_of(command)] = _Sent(command, self._loop.create_future())
        link.realtime(command)
        return sent.future

    def offer(self, engine: Engine, now: float) -> bool:
        """Hand the next command to the engine, if it takes one; whether it did."""
        while self._queue and self._queue[0].future.cancelled():
            self._queue.popleft()
        if not self._queue or engine.free() < 1:
            return False
        waiting = self._queue.popleft()
        try:
            engine.submit(waiting.command, now)
        except (MessageTooLongError, UnicodeError) as error:
            # What somebody typed does not fit the wire; nothing was sent, and the next one may.
            _refuse(waiting.future, ProblemError("invalid_request", f"It cannot be sent: {error}."))
            return self.offer(engine, now)  # nobody asks again before something else happens
        self._sent[_token_of(waiting.command)] = _Sent(waiting.command, waiting.future)
        self.touched += not isinstance(waiting.command, QUESTIONS)
        return True

    def handle(self, event: Event) -> None:
        """An event of the engine; those with a token of ours belong to an answer."""
        self.touched += isinstance(event, MachineRestarted | ControllerReset)
        token = getattr(event, "token", None)
        sent = None if token is None else self._sent.get(token)
        if sent is None:
            return
        if len(sent.events) < MAX_EVENTS:
            sent.events.append(event)
        if isinstance(event, CommandDone | CommandFailed):
            del self._sent[event.token]
            _answer(sent.future, Answer(tuple(sent.events), event))

    def withdraw(self, future: asyncio.Future[Answer]) -> bool:
        """Take a command back that was not handed over yet; whether it was still there to take."""
        waiting = next((one for one in self._queue if one.future is future), None)
        if waiting is None:
            return False
        self._queue.remove(waiting)
        future.cancel()
        return True

    def drop_jogs(self) -> None:
        """Take back the jogs that were not handed over yet."""
        kept: deque[_Waiting] = deque()
        for waiting in self._queue:
            if waiting.droppable:
                _refuse(waiting.future, ProblemError("wrong_state", "The jog was cancelled."))
            else:
                kept.append(waiting)
        self._queue = kept

    def sweep(self, problem: ProblemError) -> None:
        """Nothing more is handed over, nor the rest of a row; who waits is told why."""
        for row in self._rows:
            row.problem = row.problem or problem
        queue, self._queue = self._queue, deque()
        for waiting in queue:
            _refuse(waiting.future, problem)

    def epoch_ended(self) -> None:
        """The engine that had commands of ours is gone: what became of them is not known."""
        self.touched += 1
        problem = ProblemError("no_answer", f"The link to {self._machine} broke before the answer came.")
        self.sweep(problem)
        sent, self._sent = self._sent, {}
        for one in sent.values():
            _refuse(one.future, problem)


def _token_of(command: Command | RealtimeCommand) -> int:
    token = getattr(command, "token", None)
    assert isinstance(token, int), "a batch of a job is not a command by hand"
    return token


def _answer(future: asyncio.Future[Answer], answer: Answer) -> None:
    if not future.done():
        future.set_result(answer)


def _refuse(future: asyncio.Future[Answer], problem: ProblemError) -> None:
    if future.done():
        return
    future.set_exception(problem)
    # A jog is not awaited by anybody; its failure is no error of the loop's.
    future.exception()
