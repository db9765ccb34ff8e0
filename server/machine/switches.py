"""What is pressed at a controller while it works: overrides, coolant, spindle stop, safety door. The real-time lane.

Not the pause and the stop of jobs (controller.py). A byte has no answer: whether it was heeded is seen in the reports.
The one rule: the door's byte goes out whatever is known of the machine; what only switches is judged before.
"""

import asyncio
from collections.abc import Callable
from typing import Any, Final, Literal, TypeAlias

from protocol.commands import CoolantToggle, SafetyDoor, SpindleStopToggle
from protocol.events import Status
from protocol.grbl.realtime import FLOOD, MIST, REALTIME, SAFETY_DOOR, SPINDLE_STOP
from server.machine.controller import Controller
from server.machine.enquiries import ADVICE, check_connected, check_supported
from server.machine.overrides import Kind, Overrides
from server.problems import ProblemError

Coolant: TypeAlias = Literal["flood", "mist"]
COOLANTS: Final[dict[Coolant, bytes]] = {"flood": FLOOD, "mist": MIST}
REPORTED_WITHIN_S: Final = 3.0
"""A report tells overrides and accessories at the second one after a change or a reset (grbl II.5); two polls a second
at the slowest that is usual."""
LOOK_EVERY_S: Final = 0.05

Json = dict[str, Any]


class Switches:
    """Of one controller. Made on the loop. Every method raises ProblemError."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._name = controller.name
        self._overrides = Overrides(lambda: controller.state, controller.press, asyncio.get_running_loop())
        self._coolant = asyncio.Lock()
        """Two wishes at once would both see the state before the first was heeded."""

    def override(self, wishes: dict[Kind, int]) -> Json:
        """Begin to bring overrides about; what is asked for and what is."""
        self._check("overrides")
        self._overrides.want(wishes)
        return {
            "machine": self._name,
            "asked": self._overrides.wanted,
            "present": dict(self._controller.state.overrides),
        }

    async def coolant(self, wishes: dict[Coolant, bool]) -> Json:
        """Switch flood and mist; answers when the reports show it."""
        self._check("coolant")
        async with self._coolant:
            await self._see()
            for coolant, on in wishes.items():
                await self._switch(coolant, on=on)
            running = self._controller.state.accessories
            return {"machine": self._name, **{coolant: coolant in running for coolant in COOLANTS}}

    def spindle_stop(self) -> None:
        """Stop the spindle while the machine is held, or start it again; resuming starts it too."""
        self._check("spindle_stop")
        self._check_state(SPINDLE_STOP, "stop the spindle")
        self._controller.press(SpindleStopToggle)

    def door(self) -> None:
        """What the opened safety door does: the machine retracts or stands, spindle and coolant go off."""
        check_supported(self._controller, "door")
        self._controller.press(SafetyDoor)
        self._check_state(SAFETY_DOOR, "heed the door", "The byte was sent all the same.")

    # --- how ----------------------------------------------------------------------------------------------------

    def _check(self, capability: str) -> None:
        check_supported(self._controller, capability)
        check_connected(self._controller)

    def _check_state(self, byte: bytes, what: str, addition: str = "") -> None:
        status: Status = self._controller.state.status
        if status not in REALTIME[byte].works:
            code = "alarm_active" if status == "alarm" else "wrong_state"
            advice = f": {ADVICE[status]}" if status in ADVICE else ""
            detail = f"{self._name} does not {what} in the state {status}{advice}. {addition}"
            raise ProblemError(code, detail.strip())

    async def _see(self) -> None:
        """Until it is known what runs: reports tell accessories together with overrides."""
        if not await self._until(lambda: bool(self._controller.state.overrides)):
            raise ProblemError(
                "wrong_state",
                f"The reports of {self._name} do not tell what runs, so a toggle could switch the wrong way. "
                "Switch the overrides on in $10 (grblHAL: bit 6).",
            )

    async def _switch(self, coolant: Coolant, *, on: bool) -> None:
        if (coolant in self._controller.state.accessories) == on:
            return
        self._check_state(COOLANTS[coolant], f"switch {coolant}")
        self._controller.press(lambda token: CoolantToggle(token, coolant))
        if not await self._until(lambda: (coolant in self._controller.state.accessories) == on):
            built = " Is its firmware built with M7 (option M)?" if coolant == "mist" else ""
            raise ProblemError(
                "command_failed",
                f"{self._name} was asked to switch {coolant} {'on' if on else 'off'}, and its reports do not show it "
                f"after {REPORTED_WITHIN_S:g} s.{built}",
            )
        self._controller.tools.coolant_switched(coolant, on=on)

    async def _until(self, seen: Callable[[], bool]) -> bool:
        """Whether the reports come to show it. Raises ProblemError when the link breaks."""
        for _ in range(round(REPORTED_WITHIN_S / LOOK_EVERY_S)):
            if seen():
                return True
            await asyncio.sleep(LOOK_EVERY_S)
            if self._controller.link_status != "connected":
                raise ProblemError("no_answer", f"The link to {self._name} broke; what runs there is not known.")
        return seen()
