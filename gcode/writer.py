"""The wire text of many rows: compacted or only cleaned, in step with the interpreter (elvinto §7, gcode §6).

The one rule: a row's text is what Compactor.compact, or clean, makes of its block, whichever way it went.
"""

import numpy as np

from gcode.blocks import Blocks, CodeTable, words_between
from gcode.clean import clean
from gcode.columns import Columns
from gcode.compact import Compactor
from gcode.profile import Profile
from gcode.segments import Bools
from gcode.shorten import Sizes, texts
from gcode.words import Block


class Writer:
    """Writes the rows of one piece after the other; to be given to Reading.read as follower."""

    def __init__(self, profile: Profile, table: CodeTable, *, compact: bool) -> None:
        self._table = table
        self._compactor = Compactor(profile) if compact else None
        self._columns: Columns | None = None
        self._kept: Bools = np.zeros(0, np.bool_)
        self._single: dict[int, str] = {}

    def forget(self) -> None:
        """Somebody else may have been at the machine."""
        if self._compactor is not None:
            self._compactor.forget()

    def text(self, block: Block) -> str:
        """One block by itself."""
        return clean(block) if self._compactor is None else self._compactor.compact(block)

    def open(self, columns: Columns) -> None:
        """The rows of these columns come now."""
        self._columns = columns
        self._kept = np.zeros(len(columns.row), np.bool_)
        self._single = {}

    def block(self, row: int, block: Block) -> None:
        """A row that was interpreted by itself."""
        self._single[row] = self.text(block)

    def run(self, columns: Columns, blocks: Blocks, begin: int, end: int) -> None:
        """Plain rows."""
        if self._compactor is None:
            words = words_between(columns, begin, end)
            self._kept[words] = ~self._table.is_dropped[columns.letter[words]]
            return
        at = begin
        while at < end:
            stop = self._compactor.first_distance(blocks, self._table, at, end)
            if stop > at:
                kept = self._compactor.kept(columns, blocks, self._table, at, stop)
                self._kept[words_between(columns, at, stop)] = kept
            if stop < end:
                self.block(stop, columns.block(stop))
            at = stop + 1

    def texts(self, begin: int, end: int) -> tuple[list[str], Sizes]:
        """The texts of the rows [begin, end), which have been gone through, and their bytes; empty where nothing is to
        be sent."""
        assert self._columns is not None
        written, sizes = texts(self._columns, self._kept, shorten=self._compactor is not None)
        found, found_bytes = written[begin:end], sizes[begin:end]
        for row, text in self._single.items():
            if begin <= row < end:
                found[row - begin], found_bytes[row - begin] = text, len(text)
        return found, found_bytes
