"""Asks a controller what it is and what it keeps, and writes to it: Grbl's `$` lines. Not their JSON, not the backups.

A table says of each verb in which states the controller hears it (grbl II.6): elsewhere it would be refused, or would
wait unheard. The one rule: whoever asks gets an answer or a ProblemError within a known time; a command that was not
handed over by then is taken back, and of one that was it is said that it may still be carried out.
"""

import asyncio
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, Literal

from protocol.commands import (
    CheckMode,
    Locate,
    ReadDescriptions,
    ReadFirmware,
    ReadModal,
    ReadOffsets,
    ReadSettings,
    ReadStartupBlocks,
    Restore,
    RunBlock,
    Sleep,
    WriteInfo,
    WriteSetting,
    WriteStartupBlock,
)
from protocol.events import (
    CommandFailed,
    DescriptionsRead,
    FirmwareRead,
    ModalRead,
    OffsetsRead,
    SettingsRead,
    StartupBlocksRead,
    Status,
)
from protocol.grbl import codes
from protocol.setting import SettingDescription
from server.machine.controller import Controller
from server.machine.manual import Answer, Make
from server.problems import ProblemError

HANDED_OVER_WITHIN_S = 5.0
"""The engine takes no command while it resets, reads or is locked by an alarm; the longest of these that ends by itself
is a reset and what is read after it."""
ANSWERED_WITHIN_S = 60.0
"""A start-up block may move when it is written, and everything waits until the machine stands."""

LOOK_EVERY_S = 0.1
MODAL_EVERY_S = 1.0
"""While a job runs `$G` goes before its lines: however many ask, the stream is asked for it once in so long."""


@dataclass(frozen=True, slots=True)
class Verb:
    """`what` completes "router refused to ..."; `states`: where the controller hears it; `beside_job`: while a job runs
    too."""

    capability: str
    what: str
    states: frozenset[Status]
    beside_job: bool = False


_STILL: Final[frozenset[Status]] = frozenset({"idle", "alarm"})
_IDLE: Final[frozenset[Status]] = frozenset({"idle"})

READ_FIRMWARE: Final = Verb("firmware", "tell its firmware", _STILL)
WRITE_INFO: Final = Verb("firmware", "store the info text", _STILL)
READ_SETTINGS: Final = Verb("settings", "tell its settings", _STILL | {"check"})
WRITE_SETTING: Final = Verb("settings", "store a setting", _STILL)
READ_OFFSETS: Final = Verb("offsets", "tell its offsets", _STILL)
WRITE_OFFSET: Final = Verb("offsets", "store an offset", _IDLE)
READ_MODAL: Final = Verb("modal", "tell its modal state", _STILL | {"run", "jog", "check"}, beside_job=True)
READ_STARTUP: Final = Verb("startup_blocks", "tell its start-up blocks", _STILL)
WRITE_STARTUP: Final = Verb("startup_blocks", "store a start-up block", _IDLE)
CHECK_MODE: Final = Verb("check_mode", "switch the check mode", _IDLE | {"check"})
SLEEP: Final = Verb("sleep", "go to sleep", _STILL)
RESTORE: Final = Verb("restore", "restore its defaults", _STILL)
VERBS: Final = (
    READ_FIRMWARE, WRITE_INFO, READ_SETTINGS, WRITE_SETTING, READ_OFFSETS, WRITE_OFFSET, READ_MODAL, READ_STARTUP,
    WRITE_STARTUP, CHECK_MODE, SLEEP, RESTORE,
)  # fmt: skip

ADVICE: Final[dict[str, str]] = {
    "run": "wait until it stands",
    "jog": "wait until it stands",
    "hold": "resume or stop first",
    "home": "wait until it is homed",
    "check": "leave the check mode first",
    "door": "close the door and resume",
    "sleep": "reset wakes it up",
    "tool": "finish the tool change first",
    "offline": "wait until it reports",
}
"""What to do about a state that stands against a verb."""

_STATES_OF_ERRORS: Final = {8: "wrong_state", 9: "wrong_state", 13: "wrong_state", 77: "wrong_state", 79: "wrong_state"}
"""Refusals of the controller that are about its state; all others are `command_failed`."""


def supports(controller: Controller, capability: str) -> bool:
    """Whether this machine's protocol has something."""
    return capability in controller.verbs.capabilities


def check_supported(controller: Controller, capability: str) -> None:
    """Raises ProblemError where the controller has nothing of the kind."""
    if not supports(controller, capability):
        raise ProblemError(
            "not_supported",
            f"The {controller.config.protocol} controller of {controller.name} has no {capability.replace('_', ' ')}; "
            "its `capabilities` say what it has.",
            capability=capability,
        )


def check_connected(controller: Controller) -> None:
    """Raises ProblemError unless the machine can be spoken to."""
    if controller.link_status != "connected":
        raise ProblemError(
            "not_connected", f"{controller.name} is {controller.link_status}. Check the cable and the port."
        )


class Enquiries:
    """Of one controller. Every method raises ProblemError."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._name = controller.name
        self._modal: ModalRead | None = None
        self._modal_at = 0.0
        self._modal_alone = asyncio.Lock()

    # --- reading ------------------------------------------------------------------------------------------------

    async def firmware(self) -> FirmwareRead:
        """Version, build options, buffer sizes, help."""
        return (await self._ask(READ_FIRMWARE, ReadFirmware)).only(FirmwareRead)

    async def settings(self) -> Mapping[int, str]:
        """Every setting by number, as the controller prints it."""
        return (await self._ask(READ_SETTINGS, ReadSettings)).only(SettingsRead).values

    async def descriptions(self) -> tuple[SettingDescription, ...]:
        """What a grblHAL says of its own settings; a Grbl 1.1 refuses it (error:2)."""
        return (await self._ask(READ_SETTINGS, ReadDescriptions)).only(DescriptionsRead).descriptions

    async def offsets(self) -> OffsetsRead:
        """Work offsets, stored places, tool length, the last probing; mm."""
        return (await self._ask(READ_OFFSETS, ReadOffsets)).only(OffsetsRead)

    async def modal(self) -> ModalRead:
        """The words of the active modal groups."""
        async with self._modal_alone:
            now = asyncio.get_running_loop().time()
            if self._controller.stream.moving and self._modal is not None and now - self._modal_at < MODAL_EVERY_S:
                return self._modal
            self._modal, self._modal_at = (await self._ask(READ_MODAL, ReadModal)).only(ModalRead), now
            return self._modal

    async def startup_blocks(self) -> tuple[str, ...]:
        """In their order; empty ones too."""
        return (await self._ask(READ_STARTUP, ReadStartupBlocks)).only(StartupBlocksRead).blocks

    # --- writing ------------------------------------------------------------------------------------------------

    async def write_setting(self, number: int, value: str) -> Mapping[int, str]:
        """Store a setting; all settings as they are read back afterwards."""
        answer = await self._ask(WRITE_SETTING, lambda token: WriteSetting(token, number, value))
        return answer.only(SettingsRead).values

    async def write_info(self, text: str) -> None:
        """Store the info text."""
        await self._ask(WRITE_INFO, lambda token: WriteInfo(token, text))

    async def write_startup_block(self, index: int, block: str) -> None:
        """Store a start-up block. The controller executes it before it stores it: done when the machine stands."""
        await self._ask(WRITE_STARTUP, lambda token: WriteStartupBlock(token, index, block))
        await self._stand()

    async def run_offset_block(self, block: str) -> None:
        """A block that sets or clears an offset."""
        await self._ask(WRITE_OFFSET, lambda token: RunBlock(token, (block,)))

    async def check_mode(self, *, on: bool) -> None:
        """The parser without motion. Off is done when the controller has agreed; it resets itself then."""
        await self._ask(CHECK_MODE, lambda token: CheckMode(token, on))

    async def sleep(self) -> None:
        """Motors and spindle off; only a reset wakes it up, in alarm."""
        await self._ask(SLEEP, Sleep)

    async def restore(self, what: Literal["settings", "offsets", "all"]) -> None:
        """The firmware's defaults instead of what is stored; the controller resets itself."""
        await self._ask(RESTORE, lambda token: Restore(token, what))

    # --- how ----------------------------------------------------------------------------------------------------

    def check(self, verb: Verb) -> None:
        """Raises ProblemError unless the controller would hear this verb now."""
        controller, state = self._controller, self._controller.state
        check_supported(controller, verb.capability)
        check_connected(controller)
        if controller.stream.moving and not verb.beside_job:
            job = controller.stream.active_job
            raise ProblemError("job_active", f"Job {job} uses {self._name}. Wait for its end, or cancel it.")
        if controller.unheard_stop is not None:
            raise ProblemError("alarm_active", f"{self._name} is being stopped: the e-stop is not confirmed yet.")
        if state.pendant:
            raise ProblemError("machine_busy", f"A pendant owns {self._name} at the moment; hand it back there.")
        if (own := self._controller.own_program) is not None:
            raise ProblemError("machine_busy", f"{self._name} is running {own} from its SD card, and hears no line.")
        if state.status == "alarm":
            self._check_alarm(verb)
        elif state.status not in verb.states:
            advice = ADVICE.get(state.status, "wait until it is idle")
            raise ProblemError("wrong_state", f"{self._name} cannot {verb.what} in the state {state.status}: {advice}.")

    def _check_alarm(self, verb: Verb) -> None:
        alarm = self._controller.state.alarm
        if alarm is not None and codes.alarm(alarm.code).needs_reset:
            raise ProblemError(
                "alarm_active", f"{self._name} hears nothing but a reset ({alarm.message}): reset it, then ask again."
            )
        if "alarm" not in verb.states:
            message = "" if alarm is None else f" ({alarm.message})"
            raise ProblemError("alarm_active", f"{self._name} is in alarm{message}: home or unlock it first.")

    async def _ask(self, verb: Verb, make: Make) -> Answer:
        self.check(verb)
        future = self._controller.ask(make)
        await asyncio.wait([future], timeout=HANDED_OVER_WITHIN_S)
        if not future.done() and self._controller.manual.withdraw(future):
            raise ProblemError(
                "machine_busy", f"{self._name} takes no command at the moment; nothing was sent. Try again."
            )
        await asyncio.wait([future], timeout=ANSWERED_WITHIN_S)
        if not future.done():
            raise ProblemError(
                "no_answer",
                f"{self._name} was asked to {verb.what} and has not answered for {ANSWERED_WITHIN_S:g} s. It may still "
                f"do so when it goes on: it is in the state {self._controller.state.status}.",
            )
        answer = future.result()
        if isinstance(answer.end, CommandFailed):
            raise self._refusal(verb, answer.end)
        return answer

    async def _stand(self) -> None:
        """Until a fresh report says idle, or it takes too long; whoever asks next is told then."""
        with suppress(ProblemError):  # the block is stored; that too many others ask is for the next question to say
            for _ in range(round(ANSWERED_WITHIN_S / LOOK_EVERY_S)):
                await asyncio.wait([self._controller.ask(Locate)], timeout=HANDED_OVER_WITHIN_S)
                if self._controller.state.status != "run":
                    return
                await asyncio.sleep(LOOK_EVERY_S)

    def _refusal(self, verb: Verb, failed: CommandFailed) -> ProblemError:
        name = self._name
        if self._controller.link_status != "connected":
            return ProblemError("no_answer", f"The link to {name} broke while it was asked to {verb.what}.")
        known = None if failed.code is None else codes.ERRORS.get(failed.code)
        if failed.code is None or known is None:
            return ProblemError(
                "command_failed", f"{name} did not {verb.what}: {failed.message}.", controller_code=failed.code
            )
        return ProblemError(
            _STATES_OF_ERRORS.get(failed.code, "command_failed"),
            f"{name} refused to {verb.what} with error:{failed.code}: {known.meaning}. What to do: {known.remedy}.",
            controller_code=failed.code,
            meaning=known.meaning,
            remedy=known.remedy,
        )
