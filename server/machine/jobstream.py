"""Carries out what the runner of a machine's job wants: journal, wire, status, history. Decides nothing itself.

The one rule: effects are carried out in the order in which the runner gave them, and nothing here waits: the journal
is posted, the engine is handed a batch, and whatever happens then comes back as an event. What follows from one event
is written in one transaction: after a crash nobody finds the end of a batch without what it meant for the job.
"""

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any, assert_never

from sqlite_utils import Database

from gcode.timeline import Timeline
from jobs import history, journal, store
from jobs.delivery import STANDING
from jobs.effects import (
    OF_THE_JOURNAL,
    Effect,
    Entry,
    JournalBatch,
    MarkBatch,
    Note,
    RowStatus,
    SetHold,
    SetStatus,
    Submit,
    ToolAsk,
)
from jobs.experience import Experience
from jobs.job import ENDED, MOVING, Status
from jobs.pace import Left, Pace, Reach
from jobs.runner import Runner
from jobs.store import Row
from protocol.engine import Engine, OpenWork
from protocol.events import BatchSent, Event
from protocol.machine import MachineState
from server.background.dbthread import Db
from server.background.worker import Worker
from server.clock import Clock, seconds_since, stamp
from server.live.hub import Hub
from server.machine import jobfault
from server.machine.beginning import Beginning
from server.machine.together import Together
from server.machine.turns import Turns
from server.machine.views import job_view
from server.metrics import MachineMetrics

PROGRESS_EVERY_S = 0.25
PROGRESS_UNSEEN_S = 1.0
"""Progress is announced at most this often; changes of status always. The second is for those who come back and ask
what they have missed, while nobody is there."""
ALIVE_EVERY_S = 1.0
"""How often the last sign of life is made durable (elvinto §5.5 measures the break from it). It waits half as long for
a row to go with: by so much a break may seem longer than it was, never shorter."""
TROUBLES = frozenset({Status.FAILED, Status.INTERRUPTED})


class JobStream:
    """The job side of one machine: at most one runner. `frames` gives the last frames for the history."""

    def __init__(
        self,
        machine: str,
        *,
        db: Db,
        hub: Hub,
        clock: Clock,
        loop: asyncio.AbstractEventLoop,
        metrics: MachineMetrics,
        frames: Callable[[], dict[str, Any]],
        reader: Worker,
    ) -> None:
        self.machine = machine
        self.runner: Runner | None = None
        self.row: Row | None = None
        self.beginning = Beginning(machine, db=db, hub=hub, clock=clock)
        self.on_status: Callable[[Status], None] = lambda _status: None
        self.ask_changer: Callable[[ToolAsk], None] = lambda _ask: None
        self.on_end: Callable[[Status, str], None] = lambda _status, _code: None
        self._motion_allowed = True
        self._db = db
        self._hub = hub
        self._clock = clock
        self._loop = loop
        self._metrics = metrics
        self._pace = Pace()
        metrics.seconds_left = lambda: None if (left := self._left()) is None else left.seconds
        self._frames = frames
        self._engine: Engine | None = None
        self._todo: deque[Effect] = deque()
        self._writes = Together(db)
        self._busy = False
        self._pump: Callable[[], None] = lambda: None
        self._flush: Callable[[], None] = lambda: None
        self._turns = Turns(loop, reader, lambda: self.react([]))
        self._announcing: asyncio.Handle | None = None
        self._overdue: asyncio.TimerHandle | None = None
        self._progress_at = 0.0
        self._alive_at = 0.0
        self._ids_up_to = 0
        """No ID up to it is above the highest one that the journal knows of."""

    # --- what is derived --------------------------------------------------------------------------------------

    @property
    def status(self) -> Status | None:
        """Of the job that has this machine."""
        if self.beginning.reserved is not None:
            return Status.CHECKING
        return None if self.runner is None else self.runner.status

    @property
    def active_job(self) -> int | None:
        """The id of the job that has this machine."""
        if self.beginning.reserved is not None:
            return self.beginning.reserved
        return None if self.runner is None else self.runner.job_id

    @property
    def moving(self) -> bool:
        """A job owns the machine: nothing runs by hand beside it."""
        return self.status in MOVING

    def view(self) -> dict[str, Any] | None:
        """The job as people see it, from the runner, which knows more than the database."""
        if self.row is None or self.runner is None:
            return None
        view = job_view(self.row, self._clock, self.runner, self._left())
        return {**view, "hold": True} if self.beginning.wanted and self.beginning.held else view

    def _left(self) -> Left | None:
        """How long the job will still take."""
        if self.row is None or self.runner is None:
            return None
        cursor = self.runner.ledger.cursor
        return self._pace.left(self._loop.time(), Reach(cursor.done, cursor.sent, self.row["end_line"]))

    # --- the job ----------------------------------------------------------------------------------------------

    def begin(self, row: Row, runner: Runner, effects: list[Effect]) -> None:
        """The machine is this job's from now on."""
        self.row = row
        self.runner = runner
        runner.tools.motion_allowed = self._motion_allowed
        self._pace = self._pace.of_job(row["planned_seconds"] or 0.0, row["moving_seconds"] or 0.0)
        self.react(effects)

    def expect(self, timeline: Timeline, experience: Experience) -> None:
        """How long the job was planned to take, and how this machine keeps to plans."""
        self._pace.supply(timeline, experience)
        self._metrics.pace_factor = experience.factor

    def conditions(self, state: MachineState) -> None:
        """Overrides and holds change how fast it goes on, and what its pace so far says of the rest."""
        self._pace.conditions(state.overrides, standing=state.status in STANDING)

    def adopt_alive(self, at: str | None) -> float:
        """The last sign of life that is durable, in the loop's time; long ago when it is not known."""
        passed_s = seconds_since(self._clock, at)
        return -float("inf") if passed_s is None else self._loop.time() - passed_s

    def react(self, effects: list[Effect]) -> bool:
        """Carry out effects, and then whatever the runner can do next; True when something was submitted."""
        self._todo.extend(effects)
        if self._busy:
            return False
        self._busy = True
        self._writes.hold()
        moved = submitted = False
        try:
            while self._todo or self._advance():
                effect = self._todo.popleft()
                moved = moved or not isinstance(effect, OF_THE_JOURNAL)
                submitted = submitted or isinstance(effect, Submit)
                self._perform(effect)
        except Exception as error:  # noqa: BLE001 - the outermost loop of the job: nobody else would ever tell it
            left = [*self._todo, *jobfault.interrupted(self.runner, error)]
            self._todo.clear()
            moved = moved or bool(left)
            for effect in left:
                if not isinstance(effect, Submit):
                    self._perform(effect)
        finally:
            self._busy = False
        self._writes.release()
        self._arm()
        if self.runner is not None:
            self._turns.read_for(self.runner)
        if self.runner is not None and self.runner.over:
            self.runner = self.row = None
        if moved:
            self._pump()
        return submitted

    def offer(self) -> bool:
        """Whatever the runner can do now that all that was heard is handed over; True when something was submitted.
        Asked after every input, and mostly the next batch is written down and waits for room: then nothing is to do."""
        runner, engine = self.runner, self._engine
        if self._todo or runner is None or engine is None:
            return self.react([])
        if self._turns.pending or runner.waits(engine.next_id, engine.free()):
            return False
        return self.react([])

    def _advance(self) -> bool:
        runner, engine = self.runner, self._engine
        if runner is None or engine is None or not self._turns.admits(runner, engine.next_id, engine.free()):
            return False
        self._todo.extend(runner.advance(engine.next_id, free=engine.free() > 0))
        return bool(self._todo)

    # --- the link ---------------------------------------------------------------------------------------------

    def inherit(self) -> OpenWork | None:
        """What the next epoch's engine has to know; None when no job is under way (protocol.engine.OpenWork)."""
        if self.runner is None:
            return None
        past = self.runner.inherit()
        return OpenWork(past.batches, past.start, past.move_until, past.executed)

    def link_up(self, engine: Engine, pump: Callable[[], None], flush: Callable[[], None]) -> None:
        """A new epoch has begun; it does not take commands yet. `flush` writes what the engine has to send."""
        self._engine = engine
        self._pump = pump
        self._flush = flush

    def link_down(self, *, last_life_at: float) -> None:
        """The epoch is over."""
        self._engine = None
        self._pump = self._flush = lambda: None
        self._pace.stop()
        if self.runner is not None:
            self.react(self.runner.link_down(last_life_at=last_life_at))

    def handle(self, event: Event) -> None:
        """What the engine reports."""
        if self.runner is None or not self.runner.heeds(event):
            return
        if isinstance(event, BatchSent) and event.attempt > 1:
            self._metrics.retries += 1
        try:
            effects = self.runner.handle(event, now=self._loop.time(), at=stamp(self._clock))
        except Exception as error:  # noqa: BLE001 - as in react
            effects = jobfault.interrupted(self.runner, error)
        if effects:  # what can be done without any is done when all that was heard is handed over (link.py)
            self.react(effects)

    def heard(self, now: float) -> None:
        """The machine gave a sign of life. While a fate is being settled it does not count: the break goes on."""
        if now - self._alive_at >= ALIVE_EVERY_S and self.runner is not None and self.runner.linked:
            self.alive()

    def alive(self) -> None:
        """Make the sign of life durable."""
        self._alive_at = self._loop.time()
        at, pace = stamp(self._clock), self._pace_so_far()

        def write(db: Database) -> None:
            journal.alive(db, self.machine, at)
            if pace is not None:
                store.set_pace(db, *pace)

        self._db.post(write, linger_s=ALIVE_EVERY_S / 2)

    def _pace_so_far(self) -> tuple[int, float, float] | None:
        """The job, planned and taken seconds of what it has executed; None where nothing was measured."""
        planned_s, taken_s = self._pace.so_far()
        if self.runner is None or not planned_s > 0.0:
            return None
        return self.runner.job_id, planned_s, taken_s

    # --- effects ----------------------------------------------------------------------------------------------

    def _perform(self, effect: Effect) -> None:
        runner = self.runner
        assert runner is not None
        match effect:
            case JournalBatch(entry=entry):
                self._journal(runner, entry)
            case Submit(command=command):
                assert self._engine is not None
                self._engine.submit(command, self._loop.time())
                self._flush()  # the machine stands still until it has this; the planning of the next can wait
            case MarkBatch():
                self._writes.post(journal.mark, effect)
                self._marked(effect)
            case SetStatus():
                self._set_status(runner, effect)
            case SetHold(hold=hold):
                self._writes.post(store.set_hold, runner.job_id, hold)
                self.note("pause_demanded" if hold else "resumed")
                self.announce()
            case Note(kind=kind, data=data):
                self.note(kind, **data)
            case ToolAsk():
                self.ask_changer(effect)
            case _:
                assert_never(effect)

    def _journal(self, runner: Runner, entry: Entry) -> None:
        def durable() -> None:
            runner.feed.journaled(entry.seq, entry.wire_id)
            if self.runner is runner and runner.has_room:  # else it goes out when one of those has ended
                self.react([])

        if entry.wire_id > self._ids_up_to:
            self._ids_up_to = -(-entry.wire_id // journal.IDS_AT_ONCE) * journal.IDS_AT_ONCE
            self._writes.post(journal.raise_highest, self.machine, self._ids_up_to)
        at, again = stamp(self._clock), runner.delivery.repeats
        self._writes.post(journal.journal, self.machine, entry, at, again, then=durable)

    def _marked(self, mark: MarkBatch) -> None:
        now = self._loop.time()
        if mark.status is RowStatus.OK:
            self._metrics.batches += 1
            self._metrics.blocks += len(mark.entry.batch.blocks)
            self._metrics.inferred += mark.inferred
            self._pace.mark(now, mark.line_done)
        every_s = PROGRESS_EVERY_S if self._hub.readers else PROGRESS_UNSEEN_S
        if self._announcing is None and now - self._progress_at >= every_s:
            self._announcing = self._loop.call_soon(self.announce)

    def _set_status(self, runner: Runner, effect: SetStatus) -> None:
        at = stamp(self._clock)
        self._writes.post(lambda db: store.set_status(db, runner.job_id, effect, at=at))
        self._change_pace(effect)
        if effect.after in TROUBLES and effect.before is not effect.after:
            self.note("frames", **self._frames())
        assert self.row is not None
        self.row = {
            **self.row,
            "started_at": self.row["started_at"] or (at if effect.after is Status.RUNNING else None),
            "ended_at": at if effect.after in ENDED else None,
        }
        self.announce()
        if effect.after is Status.WAITING and not runner.has_changer:
            self._hub.publish("tool", self.machine, {"tool": effect.tool, "job": runner.job_id})
        if effect.before is not effect.after:
            if effect.after in ENDED or effect.after is Status.INTERRUPTED:
                self.on_end(effect.after, "" if effect.error is None else effect.error.code)
            self.on_status(effect.after)

    # --- the tool changer -------------------------------------------------------------------------------------

    def hear_changer(self, tell: Callable[[Runner], list[Effect]]) -> None:
        """What the tool changer says to the job (server/changer/toolchanger.py)."""
        if self.runner is not None:
            self.react(tell(self.runner))

    def tool_free(self, *, motion_allowed: bool) -> None:
        """Whether the changer lets the machine move has changed."""
        self._motion_allowed = motion_allowed
        self.hear_changer(lambda runner: runner.tool_free(motion_allowed=motion_allowed))

    def _change_pace(self, effect: SetStatus) -> None:
        """A machine that stands still by intention is not slow."""
        if effect.before is effect.after:
            return
        if effect.after is Status.RUNNING:
            self._pace.begin(self._loop.time(), effect.line_done)
            return
        self._pace.stop()
        if (pace := self._pace_so_far()) is not None:
            self._writes.post(store.set_pace, *pace)

    def note(self, kind: str, *, job: int | None = None, **data: Any) -> None:
        """Write into the history, of `job` or of the one that has this machine."""
        job, at, machine = job or self.active_job, stamp(self._clock), self.machine
        self._writes.post(lambda db: history.append(db, at=at, kind=kind, data=data, machine=machine, job=job))

    def announce(self) -> None:
        """Tell everybody how the job stands."""
        self._announcing = None
        view = self.view()
        if view is not None:
            self._progress_at = self._loop.time()
            self._hub.publish("job", self.machine, view)

    def _arm(self) -> None:
        if self._overdue is not None:
            self._overdue.cancel()
            self._overdue = None
        deadline = None if self.runner is None else self.runner.deadline()
        if deadline is not None:
            self._overdue = self._loop.call_at(deadline, self._late)

    def _late(self) -> None:
        if self.runner is not None:
            self.react(self.runner.overdue(now=max(self._loop.time(), self.runner.deadline() or 0.0)))
