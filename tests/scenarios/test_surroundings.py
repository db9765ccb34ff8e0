"""A disk that fills, a damaged database, a clock that jumps: a clear message, nothing lost, and it goes on.

A port that vanishes is in test_unplug.py and test_breaks.py, a wrong configuration in tests/server/config/test_file.py,
the power in test_kill_points.py. The judge is what the machine executed.
"""

import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from server.background.dbthread import opened, plainly
from server.problems import ProblemError
from tests.harness.process import ENVIRON, MILLSTREAM, daemon, sim_process
from tests.harness.process import MACHINE as MILL
from tests.harness.process import until as eventually
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench

BLOCKS = 60
PART = "".join(["G90\n", *(f"G1 X{x} F3000\n" for x in range(1, BLOCKS + 1)), "M30\n"])
YEAR_S = 365 * 86_400.0
SMALL_BYTES = 1024 * 1024
"""The daemon's tables take a third of it."""


def way(executed: list[str]) -> list[int]:
    """Where it was led, in order."""
    words = [block.replace("G1", "").replace("F3000", "").replace(" ", "") for block in executed]
    return [int(word[1:]) for word in words if word.startswith("X")]


WHOLE = list(range(1, BLOCKS + 1))


# --- a disk that fills ----------------------------------------------------------------------------------------


@contextmanager
def small_disk(folder: Path) -> Iterator[Path]:
    """A disk of its own that can be filled."""
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={SMALL_BYTES}", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip("a disk can be mounted by root alone: nothing of this test was run")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def fill(folder: Path) -> Path:
    """Not a byte is free any more."""
    ballast = folder / "ballast"
    with ballast.open("wb", buffering=0) as file:
        try:
            while file.write(bytes(4096)):
                pass
        except OSError:
            return ballast
    raise AssertionError("the disk has no end")


@pytest.mark.real
def test_a_disk_that_fills_stops_the_stream_and_it_goes_on_when_there_is_room(tmp_path: Path) -> None:
    with (
        small_disk(tmp_path / "data") as disk,
        sim_process(tmp_path, "--speed", "2") as (port, recording),
        daemon(tmp_path, port, elvinto="max_batch_blocks = 2", server="[limits]\ndisk_reserve_bytes = 0") as one,
    ):
        job = one.connected().job(PART)
        recording.reached(5)
        ballast = fill(disk)
        upload = one.http.post("/api/v1/programs?name=b.nc", content=b"G1 X1 F100\n" * 50_000)
        assert (upload.status_code, upload.json()["code"]) == (507, "disk_full")
        # The rows of the journal find no room: what is journaled is executed, and then the mill stands still.
        eventually(lambda: one.http.post(f"/api/v1/jobs/{job}/rerun").json().get("code") == "disk_full")
        stood = recording.blocks()
        assert way(stood) == WHOLE[: len(way(stood))]
        (program,) = one.get("/programs")
        places = [f"/jobs/{job}{part}" for part in ("", "/batches", "/events", "/report")] + ["/jobs", "/audit"]
        places += [f"/programs/{program['id']}{part}" for part in ("", "/source", f"/check?machine={MILL}")]
        for place in (*(f"/api/v1{place}" for place in (*places, "/tokens")), "/metrics"):
            answer = one.http.get(place)
            assert answer.status_code == 200, f"a full disk keeps nobody from reading {place}: {answer.text}"
        assert one.get(f"/machines/{MILL}")["link"] == "connected", "the machine is kept all the while"
        ballast.unlink()
        assert one.status(job, "completed", "failed", "interrupted")["status"] == "completed"
        assert way(recording.blocks()) == WHOLE
        # Nothing was kept of what found no room, whether the file or its row in the database was first to find none.
        assert [program["name"] for program in one.get("/programs")] == ["part.nc"]


@pytest.mark.real
def test_a_log_that_cannot_be_written_ends_nothing(tmp_path: Path) -> None:
    text = '[server]\nport = 0\ndata_dir = "d"\nlog_level = "debug"\n[[machine]]\nname = "mill"\nport = "sim:"\n'
    (tmp_path / "millstream.toml").write_text(text, encoding="utf-8")
    with (
        Path("/dev/full").open("w") as full,
        subprocess.Popen(
            [*MILLSTREAM, "serve"], cwd=tmp_path, env=ENVIRON, stdout=subprocess.PIPE, stderr=full, text=True
        ) as process,
    ):
        try:
            assert process.stdout is not None
            assert process.stdout.readline().startswith("millstream: http://")
            process.send_signal(signal.SIGTERM)
            assert process.wait(30) == 0
        finally:
            process.kill()


# --- a damaged database ---------------------------------------------------------------------------------------


@pytest.mark.real
def test_a_daemon_does_not_start_on_a_file_that_is_no_database_and_says_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "d").mkdir()
    damaged = b"SQLite format 3\x00" + b"\xff" * 8000
    (tmp_path / "d" / "millstream.db").write_bytes(damaged)
    text = '[server]\nport = 0\ndata_dir = "d"\n[[machine]]\nname = "mill"\nport = "sim:"\n'
    (tmp_path / "millstream.toml").write_text(text, encoding="utf-8")
    done = subprocess.run(
        [*MILLSTREAM, "serve"], cwd=tmp_path, env=ENVIRON, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 1
    assert "millstream.db" in done.stderr
    assert "millstream restore" in done.stderr
    assert "Traceback" not in done.stderr
    assert (tmp_path / "d" / "millstream.db").read_bytes() == damaged, "what can still be rescued is left as it is"


def test_a_damaged_page_is_told_to_whoever_reads_it_and_the_machine_stays_in_hand(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = await bench.job(PART)
        await bench.status(job["id"], "completed")
        await shop.stop()
        page = _root_page(tmp_path / "millstream.db", "batches")
        with (tmp_path / "millstream.db").open("r+b") as file:
            file.seek((page - 1) * 4096)
            file.write(b"\xff" * 4096)
        bench.shop = None
        shop = await bench.connected()
        with pytest.raises(ProblemError) as refused:
            await shop.jobs.batches(job["id"])
        assert refused.value.code == "database_error"
        assert "millstream restore" in refused.value.detail
        shop.machines[MACHINE].estop()
        await until(lambda: shop.machines[MACHINE].state.status == "alarm", within_s=10)

    run_simulated(main())


def _root_page(path: Path, table: str) -> int:
    db = opened(plainly(path))
    db.execute("pragma wal_checkpoint(truncate)")
    (row,) = db.query("select rootpage from sqlite_master where name = ?", [table])
    db.close()
    return int(row["rootpage"])


def test_what_lies_behind_a_damaged_wal_is_not_believed(tmp_path: Path) -> None:
    """SQLite takes of a -wal only what its checksums prove; the rest is as if it had never been written."""

    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        job = await bench.job(PART)
        await bench.status(job["id"], "completed")
        assert bench.shop is not None
        await bench.shop.stop()
        bench.shop = None
        (tmp_path / "millstream.db-wal").write_bytes(b"\x37\x7f\x06\x82" + b"\xaa" * 5000)
        await bench.connected()
        assert (await bench.status(job["id"], "completed"))["progress"]["line"] == BLOCKS + 2
        await bench.shop.stop()

    run_simulated(main())


# --- a clock that jumps ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("jump_s", [YEAR_S, -YEAR_S])
def test_a_clock_that_jumps_does_not_touch_a_running_job(tmp_path: Path, jump_s: float) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = await bench.job(PART)
        await until(lambda: len(way(bench.executed())) >= 20, within_s=60, step_s=0.01)
        shop.jobs.clock.set_back_s -= jump_s  # type: ignore[attr-defined]
        view = await bench.status(job["id"], "completed", "failed", "interrupted")
        assert view["status"] == "completed"
        assert way(bench.executed()) == WHOLE
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("jump_s", [YEAR_S, -YEAR_S])
def test_behind_a_jump_no_break_is_called_short(tmp_path: Path, jump_s: float) -> None:
    """How long the daemon was away is known by the clock of people alone. Nothing moves by itself on its word."""

    async def main() -> None:
        bench = Bench(tmp_path, options={"resume_within": 60.0})
        await bench.connected()
        job = (await bench.job(PART))["id"]
        await until(lambda: len(way(bench.executed())) >= 20, within_s=60, step_s=0.01)
        bench.crash()
        await bench.cable.live_alone(1.0)
        bench.set_back_s = -jump_s
        shop = await bench.connected()
        view = await bench.status(job, "interrupted")
        assert view["error"]["code"] == "break_too_long"
        stood = way(bench.executed())
        assert view["progress"]["line"] == len(stood) + 1
        await shop.jobs.recover(job, "continue")
        await bench.status(job, "completed")
        assert way(bench.executed()) == WHOLE
        await shop.stop()

    run_simulated(main())
