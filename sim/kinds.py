"""The kinds of virtual machines behind one door: settings of a kind make a machine of that kind.

The one rule: whoever serves a machine (`sim.shell`) knows its verbs only; this is the one place that knows more.
"""

from collections.abc import Callable
from typing import Protocol, TypeAlias

from sim.elvinto.machine import VirtualElvinto
from sim.elvinto.settings import SimSettings as ElvintoSettings
from sim.grbl.machine import VirtualGrbl
from sim.grbl.simsettings import SimSettings as GrblSettings
from sim.ncframe.machine import VirtualLathe
from sim.ncframe.settings import SimSettings as LatheSettings

Settings: TypeAlias = ElvintoSettings | GrblSettings | LatheSettings


class Recorded(Protocol):
    """A block, line or frame that was executed: of which command, and its text."""

    @property
    def id(self) -> int: ...

    @property
    def text(self) -> str: ...


def build(
    settings: Settings, *, now: float, on_block: Callable[[Recorded], None] | None = None
) -> VirtualElvinto | VirtualGrbl | VirtualLathe:
    """A machine that has been running for a while. `on_block` is called with every block before it is answered.

    Raises ValueError for settings that no machine of the kind has.
    """
    match settings:
        case GrblSettings():
            return VirtualGrbl(settings, now=now, on_line=on_block)
        case LatheSettings():
            return VirtualLathe(settings, now=now, on_block=on_block)
        case ElvintoSettings():
            return VirtualElvinto(settings, now=now, on_block=on_block)
