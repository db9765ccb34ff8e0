"""Programs for the API: uploads streamed to disk, the list, the source, the check, the drawing. Files: jobs/program.py.

The one rule: an upload is complete and durable, or there is nothing of it; it is never in memory as a whole.
"""

import asyncio
import errno
import logging
import sqlite3
from collections import Counter, OrderedDict
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from typing import Any

from gcode.lines import MAX_LINE_BYTES
from gcode.motion import Motion
from gcode.ncframe.rules import FrameRules
from gcode.profile import ProfileError, load_profile
from gcode.words import decode_line
from jobs import store
from jobs.batch import BatchLimits
from jobs.expansion import ExpandError, TooLargeError, store_expanded
from jobs.linecount import NotAProgramError
from jobs.program import ProgramInfo, ProgramStore, UnknownProgramError
from server.background.childworker import ChildEndedError
from server.background.dbthread import Db
from server.background.worker import Worker
from server.clock import Clock, stamp
from server.live.hub import Hub
from server.problems import ProblemError
from server.programs.plans import Planning
from server.programs.room import LOOK_EVERY_BYTES, Room, stored_bytes
from server.programs.toolpaths import Reader, Toolpath, Toolpaths
from server.programs.workpiece import Workpiece

log = logging.getLogger(__name__)

LISTED = 1000
SOURCE_LINES = 10_000
"""Most lines of one answer."""
CHECKS_KEPT = 32
UPLOAD_BYTES_S = 50_000_000
"""Uploads are taken no faster, all together: half of a gigabit line. A client on this computer, or on a quicker line,
would have most of the loop's time, and a pause has several turns of the loop."""
UPLOAD_AHEAD_S = 0.005
"""So much of it may come at once."""
CheckKey = tuple[str, str, frozenset[int] | None]
"""Program, what it is checked for, and the tools of its table."""
FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS})


def ended_problem(error: ChildEndedError) -> ProblemError:
    """Somebody, mostly the system for want of memory, has ended the process that reads large programs."""
    return ProblemError(
        "process_ended",
        f"The program was not read to its end: {error}. Ask again; memory may be short.",
    )


def disk_problem(error: OSError, what: str = "program") -> Exception:
    """What a user can mend is a problem; everything else is an error of the daemon."""
    if isinstance(error, ChildEndedError):
        return ended_problem(error)
    if error.errno in FULL:
        return ProblemError("disk_full", f"The {what} cannot be stored: {error.strerror}. Nothing of it was kept.")
    return error


class ProgramService:
    """See the head of this file. `pieces` are the machines' profiles by name, `tools` what is in a machine's table."""

    def __init__(
        self,
        programs: ProgramStore,
        *,
        db: Db,
        hub: Hub,
        clock: Clock,
        files: Worker,
        checks: Worker,
        toolpaths: Toolpaths,
        pieces: Mapping[str, Workpiece],
        tools: Callable[[str], frozenset[int] | None],
        max_upload_bytes: int,
        room: Room | None = None,
    ) -> None:
        self._programs = programs
        self._planning = Planning(programs)
        self._db = db
        self._hub = hub
        self._clock = clock
        self._files = files
        self._checks = checks
        self._toolpaths = toolpaths
        self._pieces = pieces
        self._tools = tools
        self._max_upload_bytes = max_upload_bytes
        self._room = room
        self._version = version("millstream")
        self._expanding = asyncio.Lock()
        self._in_place = asyncio.Lock()
        """File and row of a program come together and go together: what is uploaded again while it is deleted stays."""
        self._upload_paid_at = 0.0
        """When what has been uploaded so far is paid for, in the loop's time."""
        self._checked: OrderedDict[CheckKey, dict[str, Any]] = OrderedDict()
        self._checking: dict[CheckKey, asyncio.Task[dict[str, Any]]] = {}
        self._needed: Counter[str] = Counter()
        """Programs of which a job is being made: they are not deleted meanwhile."""

    async def put_aside(self) -> None:
        """What a daemon that was killed left without a row (jobs/program.py). Before the first upload."""
        listed = await self._db.run(store.program_ids)
        try:
            aside = await self._files.run(self._programs.put_aside, listed, now_s=self._clock.now().timestamp())
        except OSError as error:  # it is tried again at the next start
            log.warning("Programs without a row could not be put aside: %s", error)
            return
        for path in aside:
            log.warning(
                "No row names this program: its upload was not answered, or it was being deleted. Kept: %s", path
            )

    async def store(self, chunks: AsyncIterator[bytes], name: str) -> tuple[dict[str, Any], bool]:
        """Keep an upload; the program and whether its content is new. Raises ProblemError."""
        try:
            kept, created = await self._upload(chunks, name)
        except OSError as error:
            raise disk_problem(error) from error
        except NotAProgramError as error:
            raise ProblemError("not_a_program", f"{name}: {error}.") from error
        if created:
            self._announce(kept, "created")
        return dict(kept), created

    def _row(self, info: ProgramInfo, source: str | None = None) -> dict[str, Any]:
        return {**asdict(info), "created_at": stamp(self._clock), "source_program": source}

    def _announce(self, row: Mapping[str, Any], action: str) -> None:
        self._hub.publish("program", None, {"id": row["id"], "name": row["name"], "action": action})

    async def _upload(self, chunks: AsyncIterator[bytes], name: str) -> Any:
        stored, largest = await self._look_at_room()
        writer = await self._files.run(self._programs.writer, name)
        look_at = LOOK_EVERY_BYTES
        try:
            async for chunk in chunks:
                if self._room is not None:
                    self._room.check_total(stored, writer.bytes_written + len(chunk), largest_bytes=largest)
                if writer.bytes_written >= look_at:
                    look_at += LOOK_EVERY_BYTES
                    await self._look_at_room()
                if writer.bytes_written + len(chunk) > self._max_upload_bytes:
                    limit = self._max_upload_bytes
                    raise ProblemError("too_large", f"{name} has more than {limit} bytes (server.max_upload_bytes).")
                await self._files.run(writer.write, chunk)
                await self._pace(len(chunk))
            if writer.bytes_written == 0:
                raise ProblemError("empty_program", f"{name} is empty.")
            async with self._in_place:
                if self._room is not None and await self._db.run(store.program, writer.id) is None:
                    self._room.check_total(stored, writer.bytes_written)
                info = await self._files.run(writer.finish)
                return await self._listed(info.id, store.add_program, self._row(info))
        finally:
            await self._files.run(writer.abort)

    async def _listed(self, program_id: str, write: Callable[..., Any], *args: Any) -> Any:
        """Have the row of a program written whose file is there. Where that fails the file goes as well: it would take
        room that nobody knows of."""
        try:
            return await self._db.run(write, *args)
        except (ProblemError, sqlite3.Error):
            await self._drop_unlisted(program_id)
            raise

    async def _drop_unlisted(self, program_id: str) -> None:
        if await self._db.read(store.program, program_id) is None:
            await self._read(program_id, self._programs.delete, program_id)

    async def _look_at_room(self) -> tuple[int, int]:
        """What all programs take now, and the largest of them. Raises ProblemError when the disk is full."""
        if self._room is None:
            return 0, 0
        await self._files.run(self._room.check_disk)
        return await self._db.run(stored_bytes)

    async def _check_room(self) -> None:
        """Raises ProblemError when there is no room for more."""
        stored, _ = await self._look_at_room()
        if self._room is not None:
            self._room.check_total(stored, 1)

    async def _pace(self, size_bytes: int) -> None:
        """Leave the loop to the others for as long as these bytes may take."""
        now = asyncio.get_running_loop().time()
        self._upload_paid_at = max(self._upload_paid_at, now) + size_bytes / UPLOAD_BYTES_S
        if (ahead_s := self._upload_paid_at - now - UPLOAD_AHEAD_S) > 0:
            await asyncio.sleep(ahead_s)

    async def list(self) -> list[dict[str, Any]]:
        """The newest first."""
        return [dict(row) for row in await self._db.read(store.programs, limit=LISTED)]

    async def get(self, program_id: str) -> dict[str, Any]:
        """One program. Raises ProblemError."""
        row = await self._db.read(store.program, program_id)
        if row is None:
            raise ProblemError("unknown_program", f"There is no program {program_id!r}.")
        return dict(row)

    async def source(self, program_id: str, first: int, last: int) -> dict[str, Any]:
        """Lines `first` to `last`, at most SOURCE_LINES of them. Raises ProblemError."""
        program = await self.get(program_id)
        last = min(last, first + SOURCE_LINES - 1, program["lines"])

        def read() -> list[dict[str, Any]]:
            lines = self._programs.lines(program_id, first, last)
            return [{"line": line, "text": decode_line(raw[:MAX_LINE_BYTES])} for line, raw in lines]

        return {"id": program_id, "from": first, "to": last, "lines": await self._read(program_id, read)}

    async def check(self, program_id: str, *, machine: str | None = None, profile: str | None = None) -> dict[str, Any]:
        """The check before a run, against a machine or a profile. Raises ProblemError."""
        piece, name = self._piece(machine, profile)
        program = await self.get(program_id)
        tools = None if machine is None else self._tools(machine)
        key = program_id, name, tools  # so that what was found with another tool table is not found again
        known = self._checked.get(key)
        if known is not None:
            self._checked.move_to_end(key)
            return known
        under_way = self._checking.get(key)
        if under_way is None:
            under_way = self._checking[key] = asyncio.ensure_future(self._check(key, piece, program["bytes"]))
            under_way.add_done_callback(partial(self._end_check, key))
        return await asyncio.shield(under_way)  # it goes on for whoever asks again

    async def _check(self, key: CheckKey, piece: Workpiece, size_bytes: int) -> dict[str, Any]:
        program_id, _, tools = key
        worker = self._checks.for_bytes(size_bytes)
        report: dict[str, Any] = await self._read(
            program_id, self._planning.check, piece, program_id, tools, worker=worker
        )
        self._checked[key] = report
        if len(self._checked) > CHECKS_KEPT:
            self._checked.popitem(last=False)
        return report

    def _end_check(self, key: CheckKey, task: "asyncio.Task[dict[str, Any]]") -> None:
        del self._checking[key]
        if not task.cancelled():
            task.exception()  # it is told to those who wait; there may be none left

    @contextmanager
    def needed(self, *programs: str | None) -> Iterator[None]:
        """Inside, neither these programs nor what is made of them is deleted."""
        ids = [id for id in programs if id is not None]
        self._needed.update(ids)
        try:
            yield
        finally:
            self._needed.subtract(ids)
            self._needed = +self._needed

    async def expanded(self, program: Mapping[str, Any]) -> dict[str, Any]:
        """The plain program that is made of one with O-words, parameters or macros, once. Raises ProblemError."""
        source = program["id"]
        async with self._expanding:
            known = await self._db.run(store.expansion, source, self._version)
            if known is not None:
                return dict(known)
            info = await self._expand(source, program["name"], self._checks.for_bytes(program["bytes"]))
            made = await self._listed(info.id, store.add_expansion, source, self._row(info, source), self._version)
        if made is None:
            await self._drop_unlisted(info.id)
            raise ProblemError("unknown_program", f"Program {source!r} was deleted meanwhile.")
        kept, created = made
        if created:
            self._announce(kept, "created")
        return dict(kept)

    async def _expand(self, source: str, name: str, worker: Worker) -> ProgramInfo:
        await self._check_room()
        try:
            made: ProgramInfo = await self._read(
                source,
                partial(store_expanded, max_bytes=self._max_upload_bytes),
                self._programs,
                source,
                name,
                worker=worker,
            )
        except OSError as error:
            raise disk_problem(error, "expanded program") from error
        except TooLargeError as error:
            raise ProblemError("too_large", f"{name}: {error} (server.max_upload_bytes).") from error
        except (ExpandError, NotAProgramError) as error:
            # The check has said so before, unless a newer daemon reads the program otherwise than the one that checked.
            raise ProblemError("preflight_failed", f"{name} cannot be expanded: {error}.") from error
        return made

    async def toolpath(
        self, program_id: str, *, machine: str | None = None, profile: str | None = None, level: int = 0
    ) -> "Drawing":
        """The drawing as a machine or a profile understands the program. Raises ProblemError."""
        if machine is None and profile is None:
            readers = {(reader := Reader(piece.profile, piece.frames)).name: reader for piece in self._pieces.values()}
            if len(readers) != 1:
                raise ProblemError("invalid_request", "Name the `machine` or the `profile` that the program is for.")
            (reader,) = readers.values()
        else:
            piece, _ = self._piece(machine, profile)
            reader = Reader(piece.profile, piece.frames)
        await self.get(program_id)
        return Drawing(self._toolpaths.get(program_id, reader, level))

    async def delete(self, program_id: str) -> None:
        """Forget a program. Raises ProblemError while a job needs it."""
        program = await self.get(program_id)
        async with self._in_place:
            if {program_id, program["source_program"]} & self._needed.keys():
                raise ProblemError("program_in_use", f"A job of {program['name']} is being made.")
            job = await self._db.run(store.delete_program, program_id)
            if job is not None:
                raise ProblemError("program_in_use", f"Job {job} has not ended and needs {program['name']}.")
            await self._read(program_id, self._programs.delete, program_id)
        self._announce(program, "deleted")

    def codes(self, machine: str) -> Sequence[Mapping[str, Any]]:
        """The G, M and W codes of a machine's profile, as people type them. Raises ProblemError."""
        piece, _ = self._piece(machine, None)
        there = (code for code in piece.profile.codes.values() if code.status != "missing")
        return [{"code": code.name, "text": code.text} for code in there]

    def _piece(self, machine: str | None, profile: str | None) -> tuple[Workpiece, str]:
        if machine is not None:
            if machine not in self._pieces:
                raise ProblemError("unknown_machine", f"There is no machine {machine!r}.")
            return self._pieces[machine], f"machine {machine}"
        try:
            loaded = load_profile(profile or "elvinto")
        except ProfileError as error:
            raise ProblemError("invalid_request", f"{error}.") from error
        frames = FrameRules() if "frames" in loaded.features else None
        piece = Workpiece(loaded, Motion(), BatchLimits(), True, False, "utf-8", frames=frames)
        return piece, f"profile {loaded.name}"

    async def _read(self, program_id: str, fn: Any, *args: Any, worker: Worker | None = None) -> Any:
        worker = worker or self._files
        try:
            return await worker.run(fn, *args)
        except ChildEndedError as error:
            raise ended_problem(error) from error
        except UnknownProgramError as error:
            raise ProblemError("unknown_program", f"The file of program {program_id!r} is not there.") from error


class Drawing:
    """A toolpath whose faults are problems."""

    def __init__(self, toolpath: Toolpath) -> None:
        self._toolpath = toolpath
        self.etag = toolpath.etag

    async def open(self) -> tuple[int, AsyncIterator[bytes]]:
        """How many bytes, and the bytes. Raises ProblemError."""
        try:
            return await self._toolpath.open()
        except UnknownProgramError as error:
            raise ProblemError("unknown_program", f"The file of program {error.args[0]!r} is not there.") from error
        except OSError as error:
            raise disk_problem(error, "drawing") from error
        except ExpandError as error:
            raise ProblemError("no_preview", f"The program cannot be expanded: {error}.") from error
