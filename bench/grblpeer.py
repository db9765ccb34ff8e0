"""A virtual Grbl behind a paced TCP port as a process of its own: `python -m bench.grblpeer BAUD ACCELERATION`.

It prints the port; when its standard input ends it prints what it has seen as JSON. The one rule: what a sender did is
measured here, at the controller's end of the wire, by a clock that all processes of this computer share.
"""

import asyncio
import json
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from sim.faults import BITS_PER_BYTE
from sim.grbl.events import Executed, Move
from sim.grbl.machine import VirtualGrbl
from sim.grbl.simsettings import SimSettings
from sim.shell import Pump, TcpShell

HOST = "127.0.0.1"
FEED_HOLD = b"!"
OURS = "$"
"""Lines of the sender itself, no program's, begin so."""


@dataclass(slots=True)
class Seen:
    """Seconds and bytes; `holds_at`: when a feed hold came out of the wire, monotonic clock of the computer.

    `wire`: bytes of the program against what the line could have carried in that time. `starved_s`: the planner had
    run dry between the first and the last move; `motion_s` is from the one to the other, for a planner that has little
    ahead does not run dry, it goes slowly.
    """

    lines: int = 0
    line_bytes: int = 0
    seconds: float = 0.0
    wire: float = 0.0
    starved_s: float = 0.0
    starved: int = 0
    motion_s: float = 0.0
    most_waiting_bytes: int = 0
    dropped_bytes: int = 0
    holds_at: list[float] = field(default_factory=list)

    @property
    def lines_s(self) -> float:
        return self.lines / self.seconds if self.seconds else 0.0


class Witness:
    """Listens to what goes to a virtual controller and what comes of it."""

    def __init__(self, settings: SimSettings, *, now: float) -> None:
        self.machine = VirtualGrbl(settings, now=now, on_line=self._obeyed)
        self.lines = 0
        self._obeyed_at: list[float] = []
        self._sizes: list[int] = []
        self._rest = b""
        self._holds_at: list[float] = []
        self._told_lines = self._told_holds = 0

    def heard(self, data: bytes, now: float) -> None:
        """The sender has written this."""
        if FEED_HOLD in data:
            self._holds_at.append(now)
        whole = self._rest + data.replace(b"?", b"").replace(FEED_HOLD, b"").replace(b"~", b"")
        *lines, self._rest = whole.split(b"\n")
        self._sizes += [len(line) + 1 for line in lines if line and not line.startswith(OURS.encode())]

    def seen(self, baud: int) -> Seen:
        """What there is to say of the program so far."""
        count = min(len(self._obeyed_at), len(self._sizes))
        if count < 2:
            return Seen(holds_at=self._holds_at)
        seconds = self._obeyed_at[count - 1] - self._obeyed_at[0]
        carried = sum(self._sizes[1:count])  # the first line had come when the clock began
        moves = [move for line in self.machine.executed for move in line.moves]
        gaps = list(_gaps(moves))
        return Seen(
            lines=count - 1,
            line_bytes=carried,
            seconds=seconds,
            wire=carried * BITS_PER_BYTE / baud / seconds if baud and seconds else 0.0,
            starved_s=sum(gaps),
            starved=len(gaps),
            motion_s=_span_s(moves),
            most_waiting_bytes=self.machine.most_waiting_bytes,
            dropped_bytes=self.machine.dropped_bytes,
            holds_at=self._holds_at,
        )

    def news(self) -> dict[str, Any]:
        """When the moves began and ended that have ended since this was last asked, in order, and the feed holds."""
        executed = self.machine.executed
        moves: list[tuple[float | None, float | None]] = []
        while self._told_lines < len(executed) and executed[self._told_lines].finished:
            moves += [(move.began_at, move.ended_at) for move in executed[self._told_lines].moves]
            self._told_lines += 1
        holds = self._holds_at[self._told_holds :]
        self._told_holds += len(holds)
        return {"moves": moves, "holds_at": holds}

    def _obeyed(self, line: Executed) -> None:
        if not line.text.startswith(OURS):
            self.lines += 1
            self._obeyed_at.append(line.at)


def _gaps(moves: Iterable[Move]) -> Iterable[float]:
    """Where the next move began later than the one before it had ended."""
    ended_at: float | None = None
    for move in moves:
        if move.began_at is not None and ended_at is not None and move.began_at > ended_at + 1e-6:
            yield move.began_at - ended_at
        ended_at = move.ended_at


def _span_s(moves: Sequence[Move]) -> float:
    began_at = moves[0].began_at if moves else None
    ended_at = moves[-1].ended_at if moves else None
    return 0.0 if began_at is None or ended_at is None else ended_at - began_at


def settings(acceleration: float) -> SimSettings:
    """A controller on which short moves follow each other without a stop."""
    return SimSettings(dollar=dict.fromkeys((120, 121, 122), acceleration) | {110: 8000, 111: 8000, 112: 8000})


class _HeardPump(Pump):
    witness: Witness

    def hear(self, data: bytes) -> None:
        self.witness.heard(data, self._loop.time())
        super().hear(data)


async def serve(baud: int, acceleration: float) -> None:
    """Until standard input ends; `news` on it is answered with that, anything else with the lines obeyed so far."""
    loop = asyncio.get_running_loop()
    witness = Witness(settings(acceleration), now=loop.time())
    pump = _HeardPump(witness.machine, baud=baud)
    pump.witness = witness
    shell = TcpShell(pump)
    await shell.open(HOST, 0)
    _say({"port": shell.port})
    reader = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    while line := (await reader.readline()).strip():
        _say(witness.news() if line == b"news" else {"lines": witness.lines})
    _say(asdict(witness.seen(baud)))
    await shell.close()


def _say(what: dict[str, Any]) -> None:
    print(json.dumps(what), flush=True)


if __name__ == "__main__":
    asyncio.run(serve(int(sys.argv[1]), float(sys.argv[2])))
