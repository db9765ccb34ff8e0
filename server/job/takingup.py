"""Taking a job up on a controller that forgets its modes at a reset (Grbl): what is needed for its plan, and its view.

Not the plan (jobs/reentry.py) and not the deciding who may (recovery.py). Of every other machine there is nothing here
but the question whether its position is lost. The one rule: nothing moves while the position may be lost, or while
people have something to do, unless the request says that they know.
"""

from dataclasses import replace
from typing import Any

from gcode.held import Held
from gcode.reentry import Reentry, Way
from jobs.program import UnknownProgramError
from jobs.store import Row
from server.background.dbthread import Db
from server.config.reentry import ReentryWish
from server.job.starting import Starter
from server.machine.controller import Controller
from server.machine.modes import began_in, held_by
from server.problems import ProblemError
from server.programs.plans import NO_CLEARANCE, Entry, Plan


class TakingUp:
    """See the head of this file."""

    def __init__(self, db: Db, starter: Starter) -> None:
        self._db = db
        self._starter = starter

    def plans_for(self, controller: Controller) -> bool:
        """Whether jobs of this machine are taken up by a plan."""
        return self._starter.pieces[controller.name].reentry is not None

    # --- what has to be said ----------------------------------------------------------------------------------

    def check_homed(self, controller: Controller, row: Row, wish: ReentryWish) -> None:
        """Raises ProblemError where the position may be lost and nobody says that it is not."""
        if self._may_be_lost(controller, row) and not wish.force:
            since = "connected or reset" if self.plans_for(controller) else "restarted in the middle of the job"
            raise ProblemError(
                "wrong_state",
                f"{controller.name} was not homed since it was {since}: its position may be lost. Home it, "
                'or set its zero anew; "force": true goes on without.',
            )

    def _may_be_lost(self, controller: Controller, row: Row) -> bool:
        """A machine that remembers its lines (ElVinto) has said so when it restarted; of another nobody knows it."""
        if self._starter.pieces[controller.name].frames is not None:  # taken up at no line at all
            return False
        return not _is_homed(controller) and (self.plans_for(controller) or bool(row["restarted"]))

    def _way(self, controller: Controller, wish: ReentryWish) -> Way | None:
        piece = self._starter.pieces[controller.name]
        return None if piece.reentry is None else piece.reentry.way(wish, laser=piece.motion.laser)

    async def prepare(
        self, controller: Controller, row: Row, line: int, wish: ReentryWish
    ) -> tuple[Held | None, Entry | None]:
        """What the controller holds, and how the program is taken up at a line. Raises ProblemError."""
        if not self.plans_for(controller):
            return None, None
        held = await held_by(controller)
        if not 1 < line <= row["end_line"]:
            return held, None
        way = self._way(controller, wish)
        if way is None:
            raise ProblemError("invalid_request", f"{NO_CLEARANCE} of {controller.name}.")
        began = await began_in(self._db, row)
        return held, Entry(way, began, wish.blocks, operator_done=wish.operator_done)

    # --- what is shown ----------------------------------------------------------------------------------------

    def as_a_trial(self, wish: ReentryWish) -> ReentryWish:
        """For looking at a plan: nobody has done anything yet, and nothing is edited."""
        return replace(wish, operator_done=True, blocks=None)

    def view(self, controller: Controller, row: Row, wish: ReentryWish, line: int, plan: Plan | None) -> dict[str, Any]:
        """The plan of a line block by block, and what a request that runs it must say besides the line."""
        reentry, way = None if plan is None else plan.reentry, self._way(controller, wish)
        shown = Reentry((), 0, (), {}).to_json() if reentry is None else reentry.to_json()
        if line <= 1 and self.plans_for(controller):
            shown["warnings"] = ["From its first line the program is run as it stands: nothing is brought back before."]
        needs = []
        if self.plans_for(controller):
            needs += ["clearance"] * (way is None and line > 1)
            needs += ["operator_done"] * any(not step["text"] for step in shown["steps"])
        needs += ["force"] * self._may_be_lost(controller, row)
        return {**shown, "needs": needs, "way": None if way is None else _way_view(way)}

    async def against(self, controller: Controller, row: Row) -> str | None:
        """Why a job cannot go on behind its certain lines as if nothing had been. Grbl has no memory of lines: that it
        was not reset since shows in its modes."""
        if not self.plans_for(controller):
            return None
        held, began = await held_by(controller), await began_in(self._db, row)
        if held is None or not held.modal:
            return f"{controller.name} has not said what modes it holds."
        starter, line = self._starter, row["line_done"] + 1
        piece = starter.pieces[controller.name]
        try:
            kept = await starter.worker.run(starter.planning.keeps, piece, row, line=line, began=began, held=held)
        except (UnknownProgramError, OSError) as error:
            return f"The program cannot be read: {error}"
        if not kept:
            return "The controller does not hold what the lines before have set: it was reset. Recover from a line."
        return None


def _is_homed(controller: Controller) -> bool:
    return controller.state.homed is True


def _way_view(way: Way) -> dict[str, Any]:
    return {
        "clearance": way.clearance_mm,
        "clearance_is_machine": way.clearance_is_machine,
        "plunge_feed": way.plunge_feed_mm_min,
        "spindle_wait": way.spindle_wait_s,
    }
