"""What people ask of a machine: stop it, move it by hand, connect it. The verbs of the API; the machine is machine.py.

Not HTTP and not who may do it (server/api); what a verb is in a protocol is data (verbs.py). The one rule: e-stop,
pause, resume and stop are plain function calls that end before anything is awaited; the wire comes first, then the
job, then the history.
"""

import asyncio
from contextlib import suppress
from typing import Any

from jobs.delivery import STANDING
from jobs.job import Status
from protocol.commands import ClearAlarm, EmergencyStop, ListFiles, RunFile
from protocol.events import CommandFailed, FilesListed
from protocol.machine import tool_confirmed
from server.machine import handblocks
from server.machine.machine import Machine
from server.machine.manual import Answer, Make, MakeRealtime
from server.problems import ProblemError

ALARM_CLEARED_WITHIN_S = 5.0
"""After that a reset goes on without the answer."""
TAKEN_WITHIN_S = 3.0
"""A machine that takes no command for so long in an alarm is locked by it (grbl II.3, ALARM 1 and 2)."""
REFUSED_WITHIN_S = 0.5
"""A controller that refuses to home or to jog says so at once; whoever asked is told then."""
JOG_SHOWN_WITHIN_S = 1.0
"""A jog is answered when it is planned; a report that shows it comes within a poll or two."""
ABOUT_TO_BEGIN = " A job that is about to begin stays in the queue, on hold."
UNDER_WAY = frozenset({"run", "jog", "hold", "home", "door", "tool"})
"""Something moves, or stands in the middle of moving."""


class Controller(Machine):
    """See the head of this file."""

    # --- at once: nothing here waits --------------------------------------------------------------------------

    def chain_opened(self) -> None:
        """The external e-stop chain of the tool changer is open."""
        with suppress(ProblemError):  # the history says that the machine was not reached
            self.estop(by_changer=True)

    def estop(self, *, by_changer: bool = False) -> None:
        """W98 now, before every other byte; the job fails. Raises ProblemError when the machine cannot be reached."""
        link, job = self._link, self.stream.active_job
        if link is not None:
            self.unheard_stop = EmergencyStop(self.manual.next_token())
            link.realtime(self.unheard_stop)
        self.manual.sweep(ProblemError("command_failed", "The emergency stop was demanded."))
        self.stream.beginning.cancel()
        if self.stream.runner is not None:
            self.stream.react(self.stream.runner.emergency())
        if not by_changer:
            self.tools.estop()
        self.stream.note("estop_demanded", job=job, reached_wire=link is not None)
        if link is None:
            raise ProblemError(
                "not_connected", f"{self.name} is not connected: use the emergency button at the machine itself."
            )

    def pause(self) -> None:
        """Stand still: at once where the machine can, else after the batch in flight. Raises ProblemError."""
        runner, beginning = self.stream.runner, self.stream.beginning
        beginning.halts += 1
        runs = runner is not None and runner.can_pause
        # Whose job was interrupted may still have a machine that moves: it does what it had inside, or what was typed.
        moves = self.state.status in ("run", "jog") or (self.state.status == "idle" and self.manual.moves)
        by_hand = moves and not self.stream.moving
        if runs or by_hand:
            self._urge(self.verbs.hold)
        if beginning.wanted:
            beginning.hold(hold=True)
        if runner is not None and runs:
            self.stream.react(runner.pause())
        elif self._jogged and not by_hand:
            self.cancel_jog()
        elif not beginning.wanted and (not by_hand or self.verbs.hold is None):
            raise ProblemError("wrong_state", f"There is no running job on {self.name} to pause.{ABOUT_TO_BEGIN}")

    def resume(self) -> None:
        """Go on after a pause. Raises ProblemError."""
        runner = self.stream.runner
        if self.stream.beginning.wanted and self.stream.beginning.held:
            self.stream.beginning.hold(hold=False)
        elif runner is not None and runner.can_resume:
            self.check_takes_commands()
            self._urge(self.verbs.go_on)
            self.stream.react(runner.resume())
        elif self.verbs.go_on is not None and self.state.status in STANDING and not self.stream.moving:
            self.check_takes_commands()
            self._urge(self.verbs.go_on)
        else:
            raise ProblemError("wrong_state", f"There is no paused job on {self.name}.")

    def stop(self) -> None:
        """Cancel the job, and what was asked by hand and not sent: at once where the machine can drop what it has, else
        after the batch in flight. Raises ProblemError."""
        runner, had_manual = self.stream.runner, self.manual.busy
        self.stream.beginning.halts += 1
        # What was asked a moment ago moves before a report says so.
        under_way = self.verbs.drop is not None and (self.state.status in UNDER_WAY or self.manual.moves)
        jogged = self._jogged
        if under_way or (runner is not None and runner.flights):
            self._urge(self.verbs.drop)
        elif jogged:
            self._urge(self.verbs.cancel_jog)
        self.manual.sweep(ProblemError("command_failed", "A stop was demanded."))
        if runner is not None:
            self.stream.note("cancel_demanded")
            self.stream.react(runner.cancel())
        elif self.stream.beginning.reserved is not None:
            self.stream.beginning.cancel()
        elif not (had_manual or under_way or jogged):
            raise ProblemError("wrong_state", f"Nothing is running on {self.name}.{ABOUT_TO_BEGIN}")

    @property
    def _jogged(self) -> bool:
        """A jog was taken so short a time ago that no report may have shown it yet."""
        return self.verbs.cancel_jog is not None and self._loop.time() - self._jogged_at < JOG_SHOWN_WITHIN_S

    def cancel_jog(self) -> None:
        """Take back the jogs that are not with the machine yet, and end the one that is, where the protocol can."""
        self._urge(self.verbs.cancel_jog)
        self.manual.drop_jogs()

    def _urge(self, make: MakeRealtime | None) -> None:
        """The byte of a verb, if there is one and a link to write it to."""
        if make is not None and self._link is not None:
            self.manual.press(self._link, make)

    # --- the link ---------------------------------------------------------------------------------------------

    async def connect(self) -> None:
        """Open the port and keep it open."""
        self._reconnect.want()
        self._publish_state()

    async def disconnect(self) -> None:
        """Close the port and leave it closed. Raises ProblemError while a job runs."""
        self._check_no_job()
        self.close()

    async def reset(self) -> None:
        """The controller's own reset, at once, also in the middle of a job; without one the alarm is cleared and the
        machine greeted anew (INIT), and no job may be under way. Raises ProblemError."""
        port = self._port
        stopped = self.tools.estop_reset()
        if self.verbs.reset is not None:
            # What was asked before a reset, and had to wait, does not move anything after it.
            self.manual.sweep(ProblemError("command_failed", "A reset was demanded."))
            self.press(self.verbs.reset)
            return
        if stopped and self.stream.moving:
            return  # a job of before the daemon's start waits for its tool: now the changer can be asked
        self._check_no_job()
        if port is None:
            raise ProblemError("not_connected", f"{self.name} is not connected.")
        if self._ready and not self.manual.busy:
            answer = self.manual.put(ClearAlarm)
            self.pump()
            await asyncio.wait([answer], timeout=ALARM_CLEARED_WITHIN_S)
        self._check_no_job()
        if self._port is not port:
            raise ProblemError("no_answer", f"The link to {self.name} broke.")
        self._end_engine("the machine is being reset")
        if self.stream.runner is not None:
            # An interrupted job: INIT makes the machine forget, so what is still open will never be known.
            self.stream.react(self.stream.runner.forget())
        self._start_engine(port, None)

    def check_takes_commands(self) -> None:
        """Raises ProblemError unless the machine is connected and not in alarm."""
        if not self._ready:
            raise ProblemError("not_connected", f"{self.name} is {self.link_status}. Check the cable and the port.")
        if self.unheard_stop is not None:
            raise ProblemError("alarm_active", f"{self.name} is being stopped: the e-stop is not confirmed yet.")
        if self.state.status == "alarm":
            message = "" if self.state.alarm is None else f" ({self.state.alarm.message})"
            raise ProblemError("alarm_active", f"{self.name} is in alarm{message}: unlock it first.")

    def _check_no_job(self) -> None:
        if self.stream.moving:
            raise ProblemError("job_active", f"Job {self.stream.active_job} uses {self.name}.")

    def check_tools(self) -> None:
        """Raises ProblemError while the tool changer lets no job begin."""
        if (refusal := self.tools.io.start_refusal) is not None:
            raise ProblemError("wrong_state", f"No job can begin on {self.name}: {refusal}.")

    def check_by_hand(self) -> None:
        """Raises ProblemError unless somebody may use the machine by hand now."""
        self._check_no_job()
        self.check_takes_commands()
        if self.own_program is not None:
            raise ProblemError("machine_busy", f"{self.name} is running {self.own_program} from its SD card.")

    def check_can_start(self, *, checking: bool = False) -> None:
        """Raises ProblemError unless a job may begin now; `checking`: one that was put into check mode. A machine that
        can hold says itself whether it is at rest."""
        if self.stream.active_job is not None:
            status = self.stream.status
            raise ProblemError("job_active", f"Job {self.stream.active_job} on {self.name} is {status}.")
        self.check_by_hand()
        if self.manual.acts:
            raise ProblemError("machine_busy", f"{self.name} executes a command by hand.")
        if self.verbs.hold is not None and self.state.status not in ("idle", "check" if checking else "idle"):
            raise ProblemError("wrong_state", f"{self.name} is in the state {self.state.status}; a job begins in idle.")
        if self.state.pendant:
            raise ProblemError("machine_busy", f"A pendant owns {self.name} (MPG).")
        self.check_tools()

    # --- by hand ----------------------------------------------------------------------------------------------

    async def home(self) -> None:
        """Answers when it is accepted; the state shows the rest. Raises ProblemError."""
        if self.verbs.home is None:
            raise ProblemError(
                "not_supported",
                f"{self.name} cannot home: bring it to its place by hand, and say with G92 where that is.",
            )
        if not self.verbs.homes_in_alarm or self.state.status != "alarm":
            self.check_by_hand()
        self._check_no_job()
        await self._accepted(self.ask(self.verbs.home))

    async def _accepted(self, answer: "asyncio.Future[Answer]") -> None:
        """Raises ProblemError when the machine refuses it at once."""
        if self.verbs.refuses_at_once:
            await asyncio.wait([answer], timeout=REFUSED_WITHIN_S)
            if self.manual.withdraw(answer):
                # Left in the queue it would move the machine whenever that takes commands again.
                alarm = "" if self.state.alarm is None else f" ({self.state.alarm.message})"
                raise ProblemError(
                    "machine_busy", f"{self.name} takes no command at the moment{alarm}; nothing was sent."
                )
            if answer.done():
                _done(answer.result())

    async def unlock(self) -> None:
        """RESETALERT, or `$X`, and the end of the e-stop. Raises ProblemError."""
        stopped = self.tools.estop_reset()
        if stopped and self.stream.moving:
            return  # as in `reset`
        self._check_no_job()
        if not self._ready:
            raise ProblemError("not_connected", f"{self.name} is {self.link_status}.")
        if self.verbs.unlocks_only_in_alarm and self.state.status != "alarm":
            if stopped:
                return
            raise ProblemError("wrong_state", f"{self.name} is not in alarm: it is {self.state.status}.")
        answer = self.ask(ClearAlarm)
        await asyncio.wait([answer], timeout=TAKEN_WITHIN_S)
        if self.manual.withdraw(answer):
            alarm = "" if self.state.alarm is None else f" ({self.state.alarm.message})"
            raise ProblemError("wrong_state", f"{self.name} takes no command in this alarm{alarm}: reset it.")
        _done(await answer)

    async def run_blocks(self, blocks: list[str]) -> list[dict[str, Any]]:
        """Run blocks one after the other; a result for each that was sent. Raises ProblemError."""
        return await handblocks.run(self, blocks)

    async def jog(self, axes: dict[str, float], feed: float) -> None:
        """A relative move; answers when it is accepted. Raises ProblemError."""
        self.check_by_hand()
        if self.manual.waiting:
            raise ProblemError("machine_busy", f"{self.name} still executes the move before.")
        answer = self.manual.put(self._jog_step(axes, feed), droppable=True)
        self._jogged_at = self._loop.time()
        self.pump()
        await self._accepted(answer)

    def _jog_step(self, axes: dict[str, float], feed: float) -> Make:
        if self.hand is not None:
            return self.hand.jog(axes, feed, self.program_position)
        assert self.verbs.jog is not None
        return self.verbs.jog(axes, feed)

    @property
    def jog_ahead(self) -> int:
        """Steps of a held jog that the machine may have beyond the present one."""
        return 0 if self.verbs.cancel_jog is None else 1

    def _check_card(self) -> None:
        self.check_by_hand()
        if "sd" not in self.capabilities:
            raise ProblemError("not_supported", f"The controller of {self.name} has not said that it has an SD card.")

    async def list_files(self) -> dict[str, Any]:
        """What is on the SD card. Raises ProblemError."""
        self._check_card()
        answer = self.manual.put(ListFiles)
        self.pump()
        listed = _done(await answer).only(FilesListed)
        return {
            "card": listed.card,
            "readable": listed.readable,
            "names": list(listed.names),
            "problem": listed.problem,
        }

    async def run_file(self, name: str) -> None:
        """Run a program from the SD card; answers when it has begun. Raises ProblemError."""
        self._check_card()
        if self.verbs.hold is not None and self.state.status != "idle":
            raise ProblemError("wrong_state", f"{self.name} is in the state {self.state.status}; it must be idle.")
        answer = self.manual.put(lambda token: RunFile(token, name))
        # Before the answer: a short program may have ended when it is read.
        self.own_program = name
        self.pump()
        try:
            _done(await answer)
        except ProblemError:
            self.own_program = None
            raise

    def ask(self, make: Make) -> "asyncio.Future[Answer]":
        """Queue any command by hand; who asks has asked whether it may. Raises ProblemError when too many wait."""
        answer = self.manual.put(make)
        self.pump()
        return answer

    def press(self, make: MakeRealtime) -> "asyncio.Future[Answer]":
        """A command of the realtime lane: it is on the wire when this returns. Raises ProblemError without a link."""
        if self._link is None:
            raise ProblemError("not_connected", f"{self.name} is {self.link_status}. Check the cable and the port.")
        return self.manual.press(self._link, make)

    # --- the tool ---------------------------------------------------------------------------------------------

    async def confirm_tool(self) -> None:
        """The operator has put the tool in. Raises ProblemError."""
        runner = self.stream.runner
        waiting = runner is not None and runner.status is Status.WAITING
        if self.tools.io.may_confirm:
            if waiting:
                self.check_takes_commands()
            self.tools.confirm()
        elif runner is not None and waiting and not runner.has_changer:
            self.check_takes_commands()
            if runner.tool is not None:
                self.state = self.state._replace(tool_requested=runner.tool)
            self.state = tool_confirmed(self.state)
            if not runner.holding:
                self._urge(self.verbs.go_on)
            self.stream.note("tool_confirmed", tool=runner.tool)
            self.stream.react(runner.confirm_tool())
        elif self.state.tool_requested is not None and not waiting:
            self._urge(self.verbs.go_on)
            self.state = tool_confirmed(self.state)
        else:
            raise ProblemError("wrong_state", f"{self.name} does not wait for a tool.")
        self._publish_state()


def _done(answer: Answer) -> Answer:
    """The answer, if the command was done. Raises ProblemError."""
    end = answer.end
    if isinstance(end, CommandFailed):
        number = "" if end.code is None or str(end.code) in end.message else f" (code {end.code})"
        raise ProblemError("command_failed", f"The machine refused it{number}: {end.message}")
    return answer
