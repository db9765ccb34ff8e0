"""Where the tools really are: the pockets and the spindle. The truth that the numbers on the pins are held against.

It has no pins and no time. The one rule: no tool is ever lost or doubled, whatever the changer does.
"""

from collections.abc import Mapping


class Magazine:
    """`spindle` 0: no tool is in it. A pocket that holds tool 0 holds an empty holder, as random changers may have."""

    def __init__(self, pockets: Mapping[int, int], spindle: int, *, random: bool) -> None:
        self.pockets: dict[int, int] = dict(pockets)
        self.spindle = spindle
        self._random = random
        self._home = {tool: pocket for pocket, tool in pockets.items()}

    def holds(self, pocket: int, tool: int) -> bool:
        """This tool can be taken from that pocket. T0 takes nothing where the spindle is only emptied."""
        if tool == 0 and not self._random:
            return True
        return self.pockets.get(pocket) == tool or (tool == self.spindle and (tool != 0 or pocket == 0))

    def load(self, pocket: int, tool: int) -> bool:
        """Put the tool of the pocket into the spindle. False: it is not there, and nothing has moved."""
        if tool == self.spindle:
            return True
        if not self.holds(pocket, tool):
            return False
        old = self.spindle
        if self._random:
            self.pockets[pocket] = old
        else:
            if tool:
                self.pockets.pop(pocket)
            if old:
                self.pockets[self._free_for(old)] = old
        self.spindle = tool
        return True

    def _free_for(self, tool: int) -> int:
        """Its own pocket, or the first free one for a tool that was put in by hand."""
        home = self._home.get(tool)
        if home is not None and home not in self.pockets:
            return home
        pocket = 1
        while pocket in self.pockets:
            pocket += 1
        return pocket
