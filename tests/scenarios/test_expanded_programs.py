"""Programs with O-words, parameters, expressions and macros, from the upload to the last block, over HTTP."""

import errno
from pathlib import Path
from typing import Any

import httpx
import pytest

from jobs import expansion
from server.api import models
from tests.harness.workshop import Bench
from tests.scenarios.test_over_http import ended, exactly, get, queue, told, upload

OWORDS = """%
(a rack of pockets, with everything that LinuxCNC has for it)
G21 G90 G28
#<pitch>=7.5 #<row>=0
o100 sub (x, deep)
  G0 X#1 Y[#<_pitch_y>*2]
  o110 repeat [2]
    G1 Z[0-#2] F[300+100*#2]
    #2=[#2+1]
  o110 endrepeat
  o120 if [#1 GT 10]
    G0 Z5
  o120 endif
o100 endsub
#<_pitch_y>=2.25
M3 S1000
o200 while [#<row> LT 3]
  o100 call [#<row>*#<pitch>] [1+#<row>]
  #<row>=[#<row>+1]
o200 endwhile
M5
M30
%
"""
OWORDS_BY_HAND = """G21 G90 G28
M3 S1000
G0 X0 Y4.5
G1 Z-1 F400
G1 Z-2 F500
G0 X7.5 Y4.5
G1 Z-2 F500
G1 Z-3 F600
G0 X15 Y4.5
G1 Z-3 F600
G1 Z-4 F700
G0 Z5
M5
M30
"""
MACRO = """O0001 (main)
G21 G90
#100=1
M98 P0002 L2
WHILE [#100 LE 2] DO1
G1 Y#100 F200
#100=#100+1
END1
IF [#100 EQ 3] GOTO 20
G1 X99
N20 M30
O0002
G1 X1 F100
G1 X2
M99
"""
MACRO_BY_HAND = "G21 G90\nG1 X1 F100\nG1 X2\nG1 X1 F100\nG1 X2\nG1 Y1 F200\nG1 Y2 F200\nM30\n"


@pytest.mark.parametrize(("text", "by_hand"), [(OWORDS, OWORDS_BY_HAND), (MACRO, MACRO_BY_HAND)])
def test_it_runs_as_if_it_were_written_out_by_hand(tmp_path: Path, text: str, by_hand: str) -> None:
    async def story(bench: Bench, client: httpx.AsyncClient) -> None:
        hand = await upload(client, by_hand, "hand.nc")
        assert (await ended(client, (await queue(client, hand))["id"]))["status"] == "completed"
        expected = bench.executed()
        source = await upload(client, text, "part.ngc")
        job = await queue(client, source)
        exactly(models.JobView, job)
        done = await ended(client, job["id"])
        assert (done["status"], done["error"]) == ("completed", None)
        assert bench.executed()[len(expected) :] == expected
        assert (done["source_program"], done["program_name"]) == (source, "part.ngc (expanded)")
        program = await get(client, f"/api/v1/programs/{done['program']}")
        exactly(models.ProgramView, program)
        assert (program["source_program"], program["lines"]) == (source, done["progress"]["lines"])
        assert done["progress"]["line"] == program["lines"]
        lines = (await get(client, f"/api/v1/programs/{done['program']}/source"))["lines"]
        assert all(";@" in line["text"] for line in lines)

    told(tmp_path, story, instant=True)


def test_the_check_and_the_drawing_name_the_lines_that_were_written(tmp_path: Path) -> None:
    async def story(_bench: Bench, client: httpx.AsyncClient) -> None:
        report = await get(client, f"/api/v1/programs/{await upload(client, OWORDS)}/check?machine=router")
        exactly(models.CheckView, report)
        assert report["errors"] == []
        assert report["infos"][0]["code"] == "expanded"
        assert (report["lines"], report["bytes"]) == (23, len(OWORDS))
        assert report["expanded_lines"] == len(OWORDS_BY_HAND.splitlines()) + 1  # and the comment
        assert report["bounds"]["z"] == [-4.0, 5.0]
        plain = await get(client, f"/api/v1/programs/{await upload(client)}/check?machine=router")
        assert plain["expanded_lines"] is None
        broken = await upload(client, "G21 G90\nG1 X#<_x> F100\nM30\n")
        assert (await client.get(f"/api/v1/programs/{broken}/toolpath")).json()["code"] == "no_preview"

    told(tmp_path, story, instant=True)


@pytest.mark.parametrize(
    ("text", "line", "code"),
    [
        ("G21 G90\nG1 X#<_x> F100\nM30\n", 2, "machine_parameter"),
        ("G21 G90\nG1 X1 F100\nM98 P9\nM30\n", 3, "m98_target"),
    ],
)
def test_what_cannot_be_expanded_is_refused_with_the_report(tmp_path: Path, text: str, line: int, code: str) -> None:
    async def story(_bench: Bench, client: httpx.AsyncClient) -> None:
        body = {"program": await upload(client, text), "machine": "router", "force": True}
        answer = await client.post("/api/v1/jobs", json=body)
        assert (answer.status_code, answer.json()["code"]) == (422, "preflight_failed")
        assert [(found["line"], found["code"]) for found in answer.json()["report"]["errors"]] == [(line, code)]
        assert len(await get(client, "/api/v1/programs")) == 1
        assert await get(client, "/api/v1/jobs") == []

    told(tmp_path, story, instant=True)


def test_it_is_made_once_and_stays_what_jobs_need(tmp_path: Path) -> None:
    async def story(_bench: Bench, client: httpx.AsyncClient) -> None:
        source = await upload(client, MACRO, "part.nc")
        body = {"program": source, "machine": "router", "force": True, "hold": True}
        headers = {"Idempotency-Key": "once"}
        first = (await client.post("/api/v1/jobs", json=body, headers=headers)).json()
        assert (await client.post("/api/v1/jobs", json=body, headers=headers)).json()["id"] == first["id"]
        second = await queue(client, source, hold=True)
        plain = first["program"]
        assert (second["program"], second["id"] != first["id"]) == (plain, True)
        assert {program["id"] for program in await get(client, "/api/v1/programs")} == {source, plain}
        for id in (source, plain):
            answer = await client.delete(f"/api/v1/programs/{id}")
            assert (answer.status_code, answer.json()["code"]) == (409, "program_in_use")
        assert (await client.post(f"/api/v1/jobs/{first['id']}/cancel")).status_code == 202
        assert (await client.post(f"/api/v1/jobs/{second['id']}/resume")).status_code == 202
        assert (await ended(client, second["id"]))["status"] == "completed"
        # The uploaded one may go now; what was run can be run again.
        assert (await client.delete(f"/api/v1/programs/{source}")).status_code == 204
        again = (await client.post(f"/api/v1/jobs/{second['id']}/rerun")).json()
        assert (again["program"], again["source_program"], again["rerun_of"]) == (plain, source, second["id"])
        assert (await ended(client, again["id"]))["status"] == "completed"
        # Without the plain one it is made again.
        assert (await client.delete(f"/api/v1/programs/{plain}")).status_code == 204
        assert await upload(client, MACRO, "part.nc") == source
        assert (await queue(client, source, hold=True))["program"] == plain

    told(tmp_path, story, instant=True)


def test_the_plain_one_may_go_while_the_uploaded_one_stays(tmp_path: Path) -> None:
    async def story(_bench: Bench, client: httpx.AsyncClient) -> None:
        source = await upload(client, MACRO)
        job = await ended(client, (await queue(client, source))["id"])
        assert (await client.delete(f"/api/v1/programs/{job['program']}")).status_code == 204
        again = await queue(client, source)
        assert again["program"] == job["program"]
        assert (await ended(client, again["id"]))["status"] == "completed"

    told(tmp_path, story, instant=True)


def test_lines_are_those_of_the_plain_program(tmp_path: Path) -> None:
    async def story(bench: Bench, client: httpx.AsyncClient) -> None:
        source = await upload(client, MACRO)
        body = {"program": source, "machine": "router", "force": True, "start_line": 5}
        refused = await client.post("/api/v1/jobs", json=body)
        assert (refused.status_code, refused.json()["code"]) == (422, "invalid_request")
        plain = refused.json()["expanded_program"]
        assert plain in refused.json()["detail"]
        lines = (await get(client, f"/api/v1/programs/{plain}/source"))["lines"]
        at = next(line["line"] for line in lines if line["text"].startswith("G1 Y2"))
        job = await queue(client, plain, start_line=at)
        assert (job["source_program"], job["start_line"]) == (source, at)
        assert (await ended(client, job["id"]))["status"] == "completed"
        assert not [block for block in bench.executed() if block.startswith(("X", "G1X"))]

    told(tmp_path, story, instant=True)


def test_without_room_for_it_there_is_no_job(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def story(_bench: Bench, client: httpx.AsyncClient) -> None:
        source = await upload(client, MACRO)
        body = {"program": source, "machine": "router", "force": True}

        def full(*_args: Any) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        with monkeypatch.context() as patched:
            patched.setattr(expansion, "write_expanded", full)
            refused = await client.post("/api/v1/jobs", json=body)
        assert (refused.status_code, refused.json()["code"]) == (507, "disk_full")
        assert len(await get(client, "/api/v1/programs")) == 1
        assert await get(client, "/api/v1/jobs") == []
        assert (await client.post("/api/v1/jobs", json=body)).status_code == 201

    told(tmp_path, story, instant=True)
