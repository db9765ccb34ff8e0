"""When a program of the SD card runs, as the reports tell it; and what is not sent meanwhile."""

import pytest

from protocol.commands import ListFiles, RunBlock, RunFile
from protocol.events import Announced, CommandDone, CommandFailed, FilesListed, ProgramEnded, ProtocolFault
from tests.protocol.grbl.scene import Scene, ready

IDLE, RUN = "<Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0>", "<Run|MPos:0.000,0.000,0.000|FS:0,0|SD:{},a.nc>"


@pytest.fixture
def scene() -> Scene:
    scene = ready(opt="[FIRMWARE:grblHAL]\r\n[OPT:VNML+,100,1024,3,0]")
    scene.log.clear()
    return scene


def test_a_listing_has_files_with_their_folders_and_no_folders(scene: Scene) -> None:
    scene.engine.submit(ListFiles(1), scene.now)
    assert scene.sent() == b"$F\n"
    scene.say("[FILE:/a.nc|SIZE:12]", "[FILE:/sub|SIZE:-1]", "[FILE:/sub/b.nc|SIZE:3]", "ok")
    assert scene.take(FilesListed) == [FilesListed(1, ("a.nc", "sub/b.nc"), readable=True, card="SD")]
    assert scene.take(CommandDone) == [CommandDone(1)]


def test_a_card_that_cannot_be_listed_is_an_answer(scene: Scene) -> None:
    scene.engine.submit(ListFiles(1), scene.now)
    scene.sent()
    scene.say("error:65")
    (listed,) = scene.take(FilesListed)
    assert (listed.readable, listed.names, listed.card) == (False, (), None)
    assert listed.problem is not None
    assert "no file system" in listed.problem


def test_the_end_is_a_report_of_rest_without_the_file(scene: Scene) -> None:
    scene.engine.submit(RunFile(1, "a.nc"), scene.now)
    assert scene.sent() == b"$F=/a.nc\n"
    scene.say("ok")
    assert scene.take(CommandDone) == [CommandDone(1)]
    scene.engine.submit(RunBlock(2, ("G0X1",)), scene.now)
    assert b"G0" not in scene.sent()
    (failed,) = scene.take(CommandFailed)
    assert "SD card" in failed.message
    scene.poll(RUN.format("10.0"))
    scene.poll(RUN.format("99.9"))
    assert scene.take(ProgramEnded) == []
    scene.poll(IDLE)
    assert scene.take(ProgramEnded) == [ProgramEnded()]
    scene.engine.submit(RunBlock(3, ("G0X1",)), scene.now)
    assert scene.sent() == b"G0X1\n"


def test_errors_of_the_file_are_said_and_are_no_answers(scene: Scene) -> None:
    scene.engine.submit(RunFile(1, "a.nc"), scene.now)
    scene.sent()
    scene.say("ok", "error:26 in SD file at line 3", "error:26")
    assert [said.text for said in scene.take(Announced)] == [
        "SD card: error 26 in SD file at line 3",
        "SD card: error 26",
    ]
    assert scene.take(ProtocolFault) == []
    scene.poll(IDLE)
    assert scene.take(ProgramEnded) == [ProgramEnded()]


def test_a_grbl_has_no_card() -> None:
    scene = ready()
    scene.engine.submit(RunFile(1, "a.nc"), scene.now)
    scene.sent()
    (failed,) = scene.take(CommandFailed)
    assert "no SD card" in failed.message
