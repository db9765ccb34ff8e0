"""Tools that a program names and the tool table does not have: at their T the changer would end the job.

Not the table itself, and not what the controller can count to (words.py). The one rule: it is a warning, for the table
may be changed before the program runs.
"""

import numpy as np

from gcode.check.piece import Piece, Reporter


class ToolRules:
    """`tools` are the numbers that a T finds."""

    def __init__(self, tools: frozenset[int], reporter: Reporter) -> None:
        self._tools = np.array(sorted(tools), np.float64)
        self._reporter = reporter

    def look(self, piece: Piece) -> None:
        """One piece of the program: T words, and the Q of M61."""
        values = piece.values("T")
        missing = ~np.isin(values, self._tools)
        if missing.any():
            numbers = values[missing]

            def said(place: int) -> str:
                return f"T{numbers[place]:g} is not in the tool table: its tool change would end the job"

            rows = piece.rows_of_letter("T")[missing]
            self._reporter.rows(piece, rows, "warning", "tool_not_in_table", said, at="T")
        for row in np.unique(piece.rows_of("M61")).tolist():
            told = [word for word in piece.words(row) if word.letter == "Q" and word.value not in self._tools]
            for word in told:
                text = f"M61 Q{word.value:g} is not in the tool table: it would end the job"
                self._reporter.found.add("warning", piece.line(row), word.column, "tool_not_in_table", text)
