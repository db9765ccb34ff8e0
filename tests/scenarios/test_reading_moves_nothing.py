"""Every GET route of the daemon, with a machine at the other end of the wire: what goes out are enquiries, and no more.

Found by walking the application's own routes, so that a new one is tried without being named.
"""

import re
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.harness.apps import create_app
from tests.harness.grblworkshop import GrblBench
from tests.harness.simloop import run_simulated
from tests.harness.workshop import MACHINE, Bench
from tests.server.api.test_routing import routes_of

PROGRAM = "G21 G90\nG1 X5 F600\nM30\n"
ENQUIRIES = {
    # W90: the state; W95: the controller; READDIR: the names on the card. A header carries checksum and id.
    "elvinto": re.compile(r"CRC16,VALUE<#\d+(,MD5<#\w+)?(,ID<#\d+)?|GCODE,DATA<#W9[05]|READDIR|"),
    # ?: status; $$, $#, $G, $I, $N: settings, offsets, modes, firmware, start-up blocks; $F: files; $E..: descriptions.
    "grbl": re.compile(r"\?*(\$[$#GIN+]{1,2}|\$F\+?|\$E[A-Z]+|\$|)\?*"),
}


def addresses(app: Any, job: int, program: str) -> list[str]:
    """An address for each GET route, with ids of what is there."""
    found = []
    for method, path, _ in routes_of(app):
        if method != "GET":
            continue
        for pattern, value in (
            ("/programs/{id}", f"/programs/{program}"),
            ("/jobs/{id}", f"/jobs/{job}"),
            ("/backups/{id}", "/backups/1"),
            ("{m}", MACHINE),
            ("{path:path}", "app.js"),
        ):
            path = path.replace(pattern, value)
        assert "{" not in path, path
        found.append(path)
    return found


def overheard(machine: Any) -> bytearray:
    """Every byte that arrives at the machine from now on."""
    heard, receive = bytearray(), machine.receive_data

    def listening(data: bytes, now: float) -> None:
        heard.extend(data)
        receive(data, now)

    machine.receive_data = listening
    return heard


@pytest.mark.parametrize("protocol", ["elvinto", "grbl"])
def test_no_get_sends_anything_but_enquiries(tmp_path: Path, protocol: str) -> None:
    async def main() -> None:
        bench = Bench(tmp_path) if protocol == "elvinto" else GrblBench(tmp_path)
        shop = await bench.start()
        app = create_app(shop)
        await bench.connected()
        job = await bench.job(PROGRAM, hold=True)
        sent = overheard(bench.machine)
        place = dict(shop.machines[MACHINE].state.position)
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://127.0.0.1:8420") as client:
            walked = addresses(app, job["id"], job["program"])
            assert len(walked) > 30
            for address in walked:
                for query in ("", f"?machine={MACHINE}"):
                    answer = await client.get(address + query)
                    assert answer.status_code < 500 or answer.json()["code"] == "no_answer", f"{address}: {answer.text}"
        assert bench.executed() == []
        text = sent.decode("ascii")
        assert [said for said in re.split("[;\n]", text) if ENQUIRIES[protocol].fullmatch(said.strip()) is None] == []
        assert text, "the machine was asked for something: else this test sees nothing"
        assert dict(shop.machines[MACHINE].state.position) == place
        assert (await shop.jobs.get(job["id"]))["status"] == "queued"
        assert shop.machines[MACHINE].control is None
        await shop.stop()

    run_simulated(main())
