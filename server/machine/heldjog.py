"""Held jogs: motion for as long as a key is held, made of small relative moves while the heartbeat lives.

Not a single jog by a distance (`Controller.jog`). The one rule: no step begins after the heartbeat has stopped, so
that the machine stands still within one step after a key, a browser or a network let go.
"""

import asyncio
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from server.problems import ProblemError

HEARTBEAT_S = 0.2
"""api.md: a held jog stops by itself when its heartbeat does."""
STEP_S = 0.15
"""Run time of one step at the asked feed: the longest way that is run after a key was let go."""
BUSY_RETRY_S = 0.02
"""Between two attempts when the machine still executes the step before."""


class Jogger(Protocol):
    """What a held jog needs of a machine. `jog_ahead`: steps that it may have beyond the present one, so that it does
    not stop between them; only where a cancel ends them all."""

    @property
    def jog_ahead(self) -> int: ...
    async def jog(self, axes: dict[str, float], feed: float) -> None: ...
    def cancel_jog(self) -> None: ...


@dataclass(slots=True)
class _Held:
    owner: object
    axes: Mapping[str, float]
    feed: float
    alive_until: float
    started: asyncio.Future[None]
    task: asyncio.Task[None] | None = None
    error: ProblemError | None = field(default=None)


class HeldJogs:
    """All held jogs of the daemon: one for a machine at most, and each belongs to one socket."""

    def __init__(self, machine: Callable[[str], Jogger]) -> None:
        self._machine = machine
        self._held: dict[str, _Held] = {}

    async def beat(self, machine: str, owner: object, axes: Mapping[str, float], feed: float) -> None:
        """Begin, or keep alive, a held jog. Returns when the first step is taken; raises ProblemError when the
        machine refuses it, or has refused a later one since the last beat."""
        loop = asyncio.get_running_loop()
        held = self._held.get(machine)
        if held is not None and held.error is not None:
            del self._held[machine]
            if held.owner is owner and loop.time() <= held.alive_until:
                raise held.error
            held = None
        if held is not None and held.owner is not owner:
            raise ProblemError("machine_busy", f"Somebody else is jogging {machine} at the moment.")
        alive_until = loop.time() + HEARTBEAT_S
        if held is None:
            held = _Held(owner, axes, feed, alive_until, loop.create_future())
            self._held[machine] = held
            held.task = loop.create_task(self._run(machine, held))
            await asyncio.shield(held.started)
            return
        held.axes, held.feed, held.alive_until = axes, feed, alive_until

    def release(self, machine: str, owner: object) -> None:
        """The key was let go: no further step, and the machine is told to end the present one if it can."""
        held = self._held.get(machine)
        if held is None or held.owner is not owner:
            return
        held.alive_until = float("-inf")
        self._forget(machine, held)

    def release_all(self, owner: object) -> None:
        """The socket has closed."""
        for machine in [name for name, held in self._held.items() if held.owner is owner]:
            self.release(machine, owner)

    async def _run(self, machine: str, held: _Held) -> None:
        loop = asyncio.get_running_loop()
        ahead_s = STEP_S * self._machine(machine).jog_ahead
        step_ends_at = loop.time()
        try:
            while loop.time() < held.alive_until:
                step_ends_at = max(step_ends_at, loop.time()) + STEP_S
                await self._step(machine, held)
                # A machine that answers before the step is run must not be given a backlog of steps.
                while (rest_s := min(step_ends_at - ahead_s, held.alive_until) - loop.time()) > 0:  # noqa: ASYNC110 - beats
                    await asyncio.sleep(rest_s)
        except ProblemError as problem:
            held.error = problem
            if not held.started.done():
                held.started.set_exception(problem)
                self._forget(machine, held)
        else:
            self._forget(machine, held)

    async def _step(self, machine: str, held: _Held) -> None:
        loop = asyncio.get_running_loop()
        while loop.time() < held.alive_until:
            try:
                await self._machine(machine).jog(step(held.axes, held.feed), held.feed)
            except ProblemError as problem:
                if problem.code != "machine_busy" or not held.started.done():
                    raise
                await asyncio.sleep(BUSY_RETRY_S)
                continue
            if not held.started.done():
                held.started.set_result(None)
            return

    def _forget(self, machine: str, held: _Held) -> None:
        if self._held.get(machine) is held:
            del self._held[machine]
            self._machine(machine).cancel_jog()


def step(axes: Mapping[str, float], feed: float) -> dict[str, float]:
    """One step in the direction of `axes` (mm): as far as `feed` (mm/min) goes in STEP_S."""
    length_mm = math.hypot(*axes.values())
    way_mm = feed / 60.0 * STEP_S
    return {axis: round(value / length_mm * way_mm, 4) for axis, value in axes.items() if value}
