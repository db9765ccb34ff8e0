"""The way in: a program with O-words, parameters, expressions or Fanuc macros to plain lines (gcode §1).

What it makes has no parameters, no flow and no subprograms; every word of a block that is executed stands in it, with
its number written out. Comments stay on lines with words and on lines of their own. The one rule: the lines are those
that the control itself would execute, in its order, or there is an ExpandError.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal, assert_never

from gcode.expand.arithmetic import Dialect
from gcode.expand.blocks import Expanded, execute_setting, execute_words, remarks
from gcode.expand.errors import ExpandError, Limits, Meter, RefusalError
from gcode.expand.fanuc import execute_end, execute_jump, execute_loop
from gcode.expand.flow import execute_flow
from gcode.expand.parameters import FanucParameters, LinuxcncParameters, Parameters, SystemHook
from gcode.expand.reading import Source, read_source
from gcode.expand.run import Run
from gcode.expand.statements import (
    Flow,
    Guarded,
    Jump,
    Loop,
    LoopEnd,
    ProgramNumber,
    Statement,
    Words,
    parse_statements,
)
from gcode.expand.structure import Place, Program, survey

__all__ = ["ExpandError", "Expanded", "Expander", "Limits", "MemoryProgram", "Program"]

KEPT_LINES = 8192
"""So many lines are kept as they were read: the inside of every loop that is not huge."""


class MemoryProgram:
    """A program whose lines are in memory."""

    def __init__(self, lines: Sequence[bytes]) -> None:
        self._lines = lines

    @property
    def count(self) -> int:
        """How many lines there are."""
        return len(self._lines)

    def line(self, number: int) -> bytes | None:
        """Line `number`, from 1; None where there is none."""
        return self._lines[number - 1] if 1 <= number <= len(self._lines) else None


def _unknown(_key: int | str) -> float | None:
    return None


class Expander:
    """Settings of an expansion; each `expand` begins afresh.

    `dialect` `auto`: O-words of flow or named parameters make it LinuxCNC, else macro statements, M98 or G65 Fanuc.
    `parameters`: numbered ones that have a value from the start. `system`: asked for what the machine knows.
    `block_delete`: lines that begin with `/` are left out; otherwise they are executed and keep their `/`.
    """

    def __init__(
        self,
        dialect: Dialect | Literal["auto"] = "auto",
        limits: Limits | None = None,
        parameters: Mapping[int, float] | None = None,
        *,
        system: SystemHook = _unknown,
        block_delete: bool = False,
    ) -> None:
        self._dialect: Dialect | Literal["auto"] = dialect
        self._limits = limits or Limits()
        self._initial = dict(parameters or {})
        self._system = system
        self._block_delete = block_delete

    def expand(self, program: Program | Sequence[bytes]) -> Iterator[Expanded]:
        """The plain lines, one after the other. Raises ExpandError, before the first line or between two."""
        source = MemoryProgram(program) if isinstance(program, Sequence) else program
        structure = survey(source, self._dialect, self._limits, block_delete=self._block_delete)
        kind = LinuxcncParameters if structure.dialect == "linuxcnc" else FanucParameters
        parameters: Parameters = kind(self._initial, self._system)
        run = Run(structure, parameters, Meter(self._limits))
        return _Expansion(run, source, block_delete=self._block_delete).lines()


class _Expansion:
    """One run through a program."""

    def __init__(self, run: Run, program: Program, *, block_delete: bool) -> None:
        self._run = run
        self._program = program
        self._block_delete = block_delete
        self._kept: dict[int, tuple[Source, tuple[Statement, ...]]] = {}

    def lines(self) -> Iterator[Expanded]:
        run, count = self._run, self._program.count
        while not run.ended and run.place[0] <= count:
            line, index = run.place
            source, statements = self._read(line)
            try:
                run.meter.step()
                if index < len(statements):
                    run.place = (line, index + 1) if index + 1 < len(statements) else (line + 1, 0)
                    expanded = self._execute(source, statements[index], (line, index))
                else:
                    run.place = (line + 1, 0)
                    expanded = None if statements else self._remarks(source)
                if expanded is not None:
                    run.meter.line()
            except RefusalError as error:
                raise source.error(0, error.code, error.message) from error
            if expanded is not None:
                yield expanded
        self._check_end()

    def _read(self, line: int) -> tuple[Source, tuple[Statement, ...]]:
        kept = self._kept.get(line)
        if kept is None:
            source = read_source(line, self._program.line(line) or b"")
            skipped = source.deleted and self._block_delete
            kept = source, () if skipped else parse_statements(source, self._run.structure.dialect)
            if len(self._kept) >= KEPT_LINES:
                self._kept.clear()
            self._kept[line] = kept
        return kept

    def _remarks(self, source: Source) -> Expanded | None:
        return None if source.deleted else remarks(self._run, source)

    def _execute(self, source: Source, statement: Statement, place: Place) -> Expanded | None:
        run = self._run
        match statement:
            case Words():
                return execute_words(run, source, statement, place)
            case Flow():
                execute_flow(run, source, statement, lambda line: self._read(line)[1])
            case Loop():
                execute_loop(run, source, statement, place)
            case LoopEnd():
                execute_end(run, source, statement, place)
            case Jump():
                execute_jump(run, source, statement, place)
            case Guarded():
                if statement.condition(run.parameters):
                    return execute_setting(run, source, statement.setting)
            case ProgramNumber():
                self._begin_section(source, statement)
                # What stands beside the number is for people and would get lost with it.
                return remarks(run, source) if run.place[0] != source.line else None
            case _:
                assert_never(statement)
        return None

    def _begin_section(self, source: Source, statement: ProgramNumber) -> None:
        """A number names the main program, or the subprogram that was called; nothing else may run into it."""
        frame = self._run.frame
        first = self._run.structure.section_lines[:1]
        if frame.kind == "main" and first and first[0][0] == source.line:
            return
        if frame.kind in ("m98", "g65") and frame.start[0] == source.line:
            return
        raise source.error(
            statement.at, "not_closed", f"the program runs into O{statement.number}: M30 or M99 is missing before it"
        )

    def _check_end(self) -> None:
        frame = self._run.frame
        if not self._run.ended and frame.kind != "main":
            line = max(1, self._program.count)
            raise ExpandError(line, 1, "not_closed", f"the subprogram of line {frame.start[0]} has no M99 at its end")
