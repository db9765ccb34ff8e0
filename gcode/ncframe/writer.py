"""What of a block has to go out: the host's memory of what the machine was told last (ncframe §2).

The one rule: G of a motion, F, S and T are left out only where the machine certainly has them; M and R never, X and Z
where they are 0.
"""

from gcode.ncframe.items import Items

DWELL_G = 4


class Memory:
    """G, F, S and T as they were sent last; None: not known."""

    def __init__(self) -> None:
        self._g: int | None = None
        self._f: int | None = None
        self._s: int | None = None
        self._t: int | None = None

    def forget(self, *, tool: bool = True) -> None:
        """Somebody else may have been at the machine. `tool`: at its tools, too."""
        self._g = self._f = self._s = None
        if tool:
            self._t = None

    def items(
        self,
        *,
        g: int | None = None,
        m: int | None = None,
        x: int = 0,
        z: int = 0,
        r: int | None = None,
        f: int | None = None,
        s: int | None = None,
        t: int | None = None,
    ) -> Items:
        """What of these is to be sent; from here on the machine has it."""
        items = Items(
            g=g if g == DWELL_G or g != self._g else None,
            m=m,
            x=x or None,
            z=z or None,
            r=r,
            f=f if f != self._f else None,
            s=s if s != self._s else None,
            t=t if t != self._t else None,
        )
        if g is not None:
            # Whether G4 leaves the motion mode alone, nobody says: behind it the mode is sent anew.
            self._g = None if g == DWELL_G else g
        self._f = self._f if f is None else f
        self._s = self._s if s is None else s
        self._t = self._t if t is None else t
        return items
