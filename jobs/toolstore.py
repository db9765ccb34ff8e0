"""What is remembered of a machine's tools while no daemon runs: spindle, tool table, fault latch. In the db thread.

Not the handshake with the changer (protocol/iocontrol). The one rule: the tool table is kept as the text that people
read and write, so that nothing of it is lost in between.
"""

from dataclasses import dataclass

from sqlite_utils import Database

SAVE = """
insert into tool_changers (machine, tool, tool_known, tool_table, fault) values (?, ?, ?, ?, ?)
on conflict (machine) do update set tool = excluded.tool, tool_known = excluded.tool_known,
                                    tool_table = excluded.tool_table, fault = excluded.fault
"""


@dataclass(frozen=True, slots=True)
class KeptTools:
    """`tool`: in the spindle, 0 none, None not known. `table`: in LinuxCNC's format, None: there is none, and every
    number is a tool. `fault`: the reason of a latched fault, None without one."""

    tool: int | None = 0
    table: str | None = None
    fault: int | None = None


def load(db: Database, machine: str) -> KeptTools:
    """As it was saved last. A machine that is new has nothing in its spindle."""
    row = next(db.query("select * from tool_changers where machine = ?", [machine]), None)
    if row is None:
        return KeptTools()
    return KeptTools(row["tool"] if row["tool_known"] else None, row["tool_table"], row["fault"])


def save(db: Database, machine: str, kept: KeptTools) -> None:
    """From now on."""
    db.execute(SAVE, [machine, kept.tool or 0, kept.tool is not None, kept.table, kept.fault])
