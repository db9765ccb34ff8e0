"""What a process holds, from outside and by its allocators, and what a database holds, by table.

Not what is made of it (soak.py). The one rule: nothing is guessed: what this system or this SQLite does not tell is
nought, all through the year.
"""

import _sqlite3
import ctypes
import os
import sqlite3
from collections import Counter
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

_OF_MALLINFO2 = (
    *("arena", "ordblks", "smblks", "hblks", "hblkhd"),
    *("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"),
)


class _Malloc(ctypes.Structure):
    """`struct mallinfo2` of glibc 2.33 and later."""

    _fields_ = [(name, ctypes.c_size_t) for name in _OF_MALLINFO2]


def malloc_kb() -> float:
    """What malloc has given out and not got back: Python's pieces above 512 bytes, SQLite, numpy. 0 without glibc."""
    ask = _mallinfo()
    if ask is None:
        return 0.0
    told = ask()
    return float(told.uordblks + told.hblkhd) / 1024


@cache
def _mallinfo() -> Any:
    ask = getattr(ctypes.CDLL(None), "mallinfo2", None)
    if ask is not None:
        ask.restype = _Malloc
    return ask


def sqlite_kb() -> float:
    """What of that SQLite has, with its cache of pages (2 MB a connection at most). 0 where it does not tell."""
    ask = _memory_used()
    return 0.0 if ask is None else float(ask()) / 1024


@cache
def _memory_used() -> Any:
    ask = getattr(ctypes.CDLL(_sqlite3.__file__), "sqlite3_memory_used", None)
    if ask is not None:
        ask.restype = ctypes.c_int64
    return ask


def resident_mb() -> float:
    """As the system counts."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1024**2


def payload(db: sqlite3.Connection) -> Mapping[str, int]:
    """Bytes of the rows of each table, with those of its indexes. Empty where SQLite was built without `dbstat`."""
    try:
        found = db.execute(
            """select coalesce(tbl_name, dbstat.name), sum(payload) from dbstat
               left join sqlite_master on sqlite_master.name = dbstat.name group by 1"""
        ).fetchall()
    except sqlite3.OperationalError:
        return {}
    return Counter({str(table): int(size) for table, size in found if size})
