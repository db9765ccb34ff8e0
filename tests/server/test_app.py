"""The composition: the real parts on a real loop, with the built-in virtual machine."""

import asyncio
from pathlib import Path

import pytest

from jobs import history
from server.app import build
from server.config.model import Config
from tests.harness.simloop import run_simulated
from tests.harness.workshop import MACHINE, Bench, one_chunk

PROGRAM = b"G90\nG1 X1 F6000\nG1 X2\nG1 X3\nM30\n"


def config(folder: Path, **machine: object) -> Config:
    port = "sim:?instant=true"
    return Config.model_validate(
        {"server": {"data_dir": str(folder)}, "machine": [{"name": MACHINE, "port": port, **machine}]}
    )


@pytest.mark.real
def test_a_program_runs_with_the_real_parts_and_a_second_daemon_finds_the_history(tmp_path: Path) -> None:
    async def main() -> None:
        shop = build(config(tmp_path))
        await shop.start()
        async with asyncio.timeout(30):
            while shop.machines[MACHINE].link_status != "connected":
                await asyncio.sleep(0.01)
            stored, _ = await shop.programs.store(one_chunk(PROGRAM), "part.nc")
            job = await shop.jobs.create(stored["id"], MACHINE, force=True)
            while job["status"] != "completed":
                await asyncio.sleep(0.01)
                job = await shop.jobs.get(job["id"])
        await shop.stop()

        again = build(config(tmp_path, autoconnect=False))
        await again.start()
        assert (await again.jobs.get(job["id"]))["status"] == "completed"
        assert again.machines[MACHINE].link_status == "disconnected"
        assert await again.db.run(history.verify) is None
        await again.stop()

    asyncio.run(main())


def test_a_machine_that_is_not_to_be_connected_is_not(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, options={"autoconnect": False})
        shop = await bench.start()
        await asyncio.sleep(60)
        assert bench.cable.opened == 0
        await shop.machines[MACHINE].connect()
        await bench.connected()
        await shop.machines[MACHINE].disconnect()
        await asyncio.sleep(60)
        assert bench.cable.opened == 1
        await shop.stop()

    run_simulated(main())


def test_a_daemon_that_ends_in_mid_job_leaves_it_to_the_next(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, options={"resume_within": 60.0})
        shop = await bench.connected()
        job = await bench.job("G90\n" + "".join(f"G1 X{i} Y{i % 7} F6000\n" for i in range(1, 60)) + "M30\n")
        await asyncio.sleep(1.0)
        await shop.stop()
        bench.shop = None
        await bench.cable.live_alone(2.0)
        shop = await bench.connected()
        await bench.status(job["id"], "completed")
        blocks = [block.removeprefix("G1").removesuffix("F6000") for block in bench.executed()]
        assert blocks == ["G90", *[f"X{i}Y{i % 7}" for i in range(1, 60)], "M30"]
        await shop.stop()

    run_simulated(main())
