"""O-words of LinuxCNC: what each does to the run. Not what belongs together; that is structure.py.

The one rule: a condition is computed only when it is reached, and only when no part before it was taken.
"""

from collections.abc import Callable, Sequence
from math import floor

from gcode.expand.arithmetic import as_number, integer
from gcode.expand.errors import ExpandError
from gcode.expand.parameters import LINUXCNC_LOCALS
from gcode.expand.reading import Source
from gcode.expand.run import Frame, Run
from gcode.expand.statements import Flow, Statement
from gcode.expand.structure import Link

Lookup = Callable[[int], Sequence[Statement]]
"""The statements of a line."""


def execute_flow(run: Run, source: Source, flow: Flow, lookup: Lookup) -> None:
    """Carry out one O-word. `run.place` stands behind it. Raises ExpandError or RefusalError."""
    if flow.keyword == "CALL":
        _call(run, source, flow)
        return
    link = run.structure.links.get(source.line)
    if link is None:
        raise source.error(flow.at, "not_nested", f"{flow.keyword.lower()} does not belong to any block")
    match flow.keyword:
        case "IF":
            _if(run, link, flow, lookup)
        case "WHILE":
            _while(run, link, flow)
        case "REPEAT":
            _repeat(run, link, flow)
        case "ENDREPEAT":
            _end_repeat(run, link)
        case "ENDSUB" | "RETURN":
            _return(run, source, flow)
        case "ENDWHILE":
            run.jump((link.start, 0))
        case "CONTINUE":
            run.jump((link.start if link.kind == "WHILE" else link.end, 0))
        case "ELSEIF" | "ELSE" | "BREAK" | "SUB":
            # An else reached from above: the part before was taken. A sub in the way is stepped over.
            run.jump((link.end + 1, 0))
        case _:
            pass  # DO and ENDIF only mark a place


def _while(run: Run, link: Link, flow: Flow) -> None:
    """`while` opens a loop of its own, or closes the `do` with its label."""
    if link.kind == "DO":
        if _true(run, flow):
            run.jump((link.start + 1, 0))
    elif not _true(run, flow):
        run.jump((link.end + 1, 0))


def _true(run: Run, flow: Flow) -> bool:
    return bool(flow.arguments[0](run.parameters))


def _if(run: Run, link: Link, flow: Flow, lookup: Lookup) -> None:
    if _true(run, flow):
        return
    for line in link.parts[1:]:
        statement = _flow_at(lookup, line)
        if statement.keyword == "ELSEIF" and not _true(run, statement):
            run.meter.step()
            continue
        run.jump((line + 1, 0))
        return


def _flow_at(lookup: Lookup, line: int) -> Flow:
    statements = lookup(line)
    if len(statements) != 1 or not isinstance(statements[0], Flow):
        raise ExpandError(line, 1, "not_nested", "the program changed while it was read")
    return statements[0]


def _repeat(run: Run, link: Link, flow: Flow) -> None:
    # To the nearest integer, halves up, as LinuxCNC does.
    turns = floor(as_number(flow.arguments[0](run.parameters)) + 0.5)
    if turns <= 0:
        run.jump((link.end + 1, 0))
    else:
        run.frame.counters[link.start] = turns


def _end_repeat(run: Run, link: Link) -> None:
    left = run.frame.counters.get(link.start, 1) - 1
    run.frame.counters[link.start] = left
    if left > 0:
        run.jump((link.start + 1, 0), counted=True)


def _call(run: Run, source: Source, flow: Flow) -> None:
    label = flow.label
    if flow.computed is not None:
        number = flow.computed(run.parameters)
        label = str(run.located(source, flow.at, lambda: integer(number, "an O-number")))
    link = run.structure.subs.get(label)
    if link is None:
        raise source.error(
            flow.at,
            "sub_not_found",
            f"sub o{label.lower()} is not in this program: copy its file into this one, before the end",
        )
    values = [as_number(argument(run.parameters)) for argument in flow.arguments]
    arguments = dict.fromkeys(range(1, LINUXCNC_LOCALS + 1), 0.0)
    arguments.update(enumerate(values, 1))
    run.call(Frame("sub", (source.line, 0), run.place, (link.start + 1, 0)))
    run.parameters.push(arguments)


def _return(run: Run, source: Source, flow: Flow) -> None:
    if run.frame.kind != "sub":
        what = flow.keyword.lower()
        raise source.error(flow.at, "not_nested", f"{what} in a subprogram that M98 called: end it with M99")
    value = flow.arguments[0](run.parameters) if flow.arguments else None
    run.leave()
    run.parameters.pop()
    run.parameters.returned(value)
