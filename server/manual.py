"""Commands by hand: waits for the engine to be free, hands them over one by one, tells the caller what came of them.

Not the permission to do so (controller.py asks first). The one rule: whoever waits is always answered: by the
machine, or because the epoch ended, or because an emergency stop swept the queue.
"""

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from protocol.commands import Command
from protocol.engine import Engine
from protocol.errors import MessageTooLongError
from protocol.events import CommandDone, CommandFailed, Event, FilesListed
from server.problems import ProblemError

QUEUE_LIMIT = 4
"""Commands by hand that wait, so that a held jog does not stop between two steps. More are refused."""

Make = Callable[[int], Command]


@dataclass(slots=True)
class _Waiting:
    command: Command
    future: asyncio.Future[CommandDone | CommandFailed | FilesListed]
    droppable: bool


class Manual:
    """The commands by hand of one machine."""

    def __init__(self, machine: str, loop: asyncio.AbstractEventLoop) -> None:
        self._machine = machine
        self._loop = loop
        self._token = 0
        self._queue: deque[_Waiting] = deque()
        self._sent: dict[int, asyncio.Future[CommandDone | CommandFailed | FilesListed]] = {}

    @property
    def busy(self) -> bool:
        """Something by hand is under way."""
        return bool(self._queue or self._sent)

    @property
    def waiting(self) -> bool:
        """Something by hand is not with the machine yet."""
        return bool(self._queue)

    def next_token(self) -> int:
        """A token that no other command has."""
        self._token += 1
        return self._token

    def put(self, make: Make, *, droppable: bool = False) -> asyncio.Future[CommandDone | CommandFailed | FilesListed]:
        """Queue a command; the future is the answer. `droppable`: a jog cancel may still take it back."""
        if len(self._queue) >= QUEUE_LIMIT:
            raise ProblemError("machine_busy", f"{self._machine} still has {len(self._queue)} commands to execute.")
        future: asyncio.Future[CommandDone | CommandFailed | FilesListed] = self._loop.create_future()
        self._queue.append(_Waiting(make(self.next_token()), future, droppable))
        return future

    def offer(self, engine: Engine, now: float) -> bool:
        """Hand the next command to the engine, if it takes one; whether it did."""
        if not self._queue or engine.free() < 1:
            return False
        waiting = self._queue.popleft()
        try:
            engine.submit(waiting.command, now)
        except (MessageTooLongError, UnicodeError) as error:
            # What somebody typed does not fit the wire; nothing was sent, and the next one may.
            _refuse(waiting.future, ProblemError("invalid_request", f"It cannot be sent: {error}."))
            return False
        self._sent[_token_of(waiting.command)] = waiting.future
        return True

    def handle(self, event: Event) -> None:
        """An answer of the engine."""
        match event:
            case FilesListed(token=token) if (future := self._sent.get(token)) is not None:
                _answer(future, event)
            case CommandDone(token=token) | CommandFailed(token=token):
                future = self._sent.pop(token, None)
                if future is not None:
                    _answer(future, event)
            case _:
                pass

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
        """Nothing more is handed over; who waits in the queue is told why."""
        queue, self._queue = self._queue, deque()
        for waiting in queue:
            _refuse(waiting.future, problem)

    def epoch_ended(self) -> None:
        """The engine that had commands of ours is gone: what became of them is not known."""
        problem = ProblemError("no_answer", f"The link to {self._machine} broke before the answer came.")
        self.sweep(problem)
        sent, self._sent = self._sent, {}
        for future in sent.values():
            _refuse(future, problem)


def _token_of(command: Command) -> int:
    token = getattr(command, "token", None)
    assert isinstance(token, int), "a batch of a job is not a command by hand"
    return token


def _answer(
    future: asyncio.Future[CommandDone | CommandFailed | FilesListed], event: CommandDone | CommandFailed | FilesListed
) -> None:
    if not future.done():
        future.set_result(event)


def _refuse(future: asyncio.Future[CommandDone | CommandFailed | FilesListed], problem: ProblemError) -> None:
    if future.done():
        return
    future.set_exception(problem)
    # A jog is not awaited by anybody; its failure is no error of the loop's.
    future.exception()
