"""Asking a controller who it is: the virtual machines in every dialect, in virtual time, and nothing of them moves."""

from itertools import product
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from server.doctor.ask import ORDER, Answer, Talk, ask
from sim.elvinto.settings import SimSettings
from sim.grbl.simsettings import SimSettings as GrblSettings
from sim.kinds import build
from sim.ncframe.settings import SimSettings as LatheSettings

HARMLESS = (b"\x05", b"?", b"$I\n")
STEP_S = 0.005
ANSWERS = (
    b"\x06",
    b"\x06\x00\x00\x00\x07",
    b"\x15",
    b"ok\r\n",
    b"<Idle|MPos:0.000,0.000,0.000|FS:0,0>\r\n",
    b"<Run|MPos:1.000,0.000,0.000|FS:0,0>\r\n",
    b"Grbl 1.1h ['$' for help]\r\n",
    b"[VER:1.1h.20190830:]\r\n",
    b"READY;",
    b"CRC16,VALUE<#864,MD5<#a1fe1328575795c2966c395eb88d2c51;READY;",
)


class SimLine:
    """A line to a virtual machine on which time passes only while somebody listens."""

    def __init__(self, settings: Any) -> None:
        self.machine: Any = build(settings, now=0.0)
        self.now = 0.0

    def say(self, data: bytes) -> None:
        self.machine.receive_data(data, self.now)

    def hear(self, seconds: float) -> bytes:
        ends_at, heard = self.now + seconds, b""
        while self.now < ends_at:
            self.now += STEP_S
            self.machine.handle_timer(self.now)
            heard += self.machine.data_to_send(self.now)
        return heard


class Script:
    """A line on which each question has its answer."""

    def __init__(self, said: dict[bytes, bytes], greeting: bytes = b"") -> None:
        self.said, self.waiting = said, greeting

    def say(self, data: bytes) -> None:
        self.waiting += self.said.get(data, b"")

    def hear(self, seconds: float) -> bytes:
        heard, self.waiting = self.waiting, b""
        return heard


def asked(line: Any, *protocols: Any, restarts: bool = False) -> tuple[Answer, Talk]:
    talk = Talk(line)
    answer = ask(talk, protocols or ORDER, restarts=restarts)
    assert answer is not None, talk
    return answer, talk


@pytest.mark.parametrize(
    ("name", "radix", "scope", "repeat"),
    list(product(("CRC16", "CRC"), (10, 16), ("message", "gcode"), ("silent", "reack"))),
)
def test_every_dialect_of_elvinto_is_told(name: str, radix: int, scope: str, repeat: str) -> None:
    line = SimLine(SimSettings(header_name=name, crc_radix=radix, checksum_scope=scope, repeat=repeat))  # type: ignore[arg-type]
    answer, _ = asked(line)
    assert answer.protocol == "elvinto"
    assert answer.dialect == {
        "header_name": name,
        "crc_radix": radix,
        "checksum_scope": scope,
        "require_header": True,
    }
    assert answer.unsure == ()
    assert {each.text for each in line.machine.executed} <= {"W95"}


def test_what_a_silent_elvinto_machine_does_not_tell_is_named() -> None:
    line = SimLine(SimSettings(repeat="silent"))
    line.machine.last_id = 900
    answer, _ = asked(line, "elvinto")
    assert answer.unsure == ("checksum_scope",)
    assert line.machine.executed == []
    assert line.machine.last_id == 900


@pytest.mark.parametrize("counter", [True, False])
@pytest.mark.parametrize("framing", ["gap", "length"])
def test_a_lathe_is_told_by_its_first_byte(counter: bool, framing: str) -> None:
    line = SimLine(LatheSettings(counter=counter, framing=framing))  # type: ignore[arg-type]
    answer, talk = asked(line)
    assert (answer.protocol, answer.dialect) == ("ncframe", {"counter": counter})
    assert talk.sent == [b"\x05"]
    assert line.machine.executed == []


@pytest.mark.parametrize(("flavour", "firmware"), [("1.1h", "grbl-1.1"), ("grblHAL", "grblhal")])
def test_a_grbl_is_told_with_its_version(flavour: str, firmware: str) -> None:
    line = SimLine(GrblSettings(flavour=flavour))  # type: ignore[arg-type]
    answer, talk = asked(line)
    assert (answer.protocol, answer.dialect["firmware"]) == ("grbl", firmware)
    assert "state" in answer.says
    assert set(talk.sent) <= set(HARMLESS)


def test_a_banner_after_opening_says_that_the_board_restarts() -> None:
    banner = b"\r\nGrbl 1.1h ['$' for help]\r\n"
    report = b"<Alarm|MPos:0.000,0.000,0.000|FS:0,0>\r\n"
    answer, _ = asked(Script({b"?": report}, banner), "grbl", restarts=True)
    assert answer.dialect == {"firmware": "grbl-1.1", "resets_on_open": True}


@pytest.mark.parametrize("state", ["Run", "Hold:0", "Jog", "Home", "Door:0", "Sleep", "Check"])
def test_a_grbl_at_work_gets_no_line(state: str) -> None:
    report = f"<{state}|MPos:0.000,0.000,0.000|FS:0,0>\r\n".encode()
    answer, talk = asked(Script({b"?": report}))
    assert answer.protocol == "grbl"
    assert answer.unsure == ("firmware",)
    assert b"$I\n" not in talk.sent


def test_a_machine_without_check_headers_is_told_from_one_that_has_them() -> None:
    class Headerless(Script):
        def say(self, data: bytes) -> None:
            if data.endswith(b"READY;"):
                self.waiting += b"READY;"

    answer, _ = asked(Headerless({}), "elvinto")
    assert answer.dialect["require_header"] is False


@pytest.mark.parametrize("byte", [b"\x15", b"\x13", b"\x18"])
def test_whatever_a_lathe_says_no_text_goes_to_it(byte: bytes) -> None:
    for question in (b"\x05", b"?"):
        talk = Talk(Script({question: byte}))
        assert ask(talk) is None
        assert set(talk.sent) <= {b"\x05", b"?"}


def test_a_machine_that_is_known_is_asked_in_its_language_alone() -> None:
    talk = Talk(Script({}))
    assert ask(talk, ("grbl",)) is None
    assert set(talk.sent) == {b"?"}
    talk = Talk(Script({}))
    assert ask(talk, ("ncframe",)) is None
    assert set(talk.sent) == {b"\x05"}


def test_nobody_there_and_only_the_harmless_was_said() -> None:
    talk = Talk(Script({}))
    assert ask(talk) is None
    assert {data for data in talk.sent if not data.endswith(b";")} == {b"\x05", b"?"}
    assert all(data.endswith(b";READY;") for data in talk.sent if data.endswith(b";"))


@settings(max_examples=150, deadline=None)
@given(st.lists(st.binary(max_size=40) | st.sampled_from(ANSWERS), max_size=30))
def test_whatever_comes_back_nothing_raises_and_nothing_else_is_sent(pieces: list[bytes]) -> None:
    class Replies(Script):
        def hear(self, seconds: float) -> bytes:
            return pieces.pop(0) if pieces else b""

    talk = Talk(Replies({}))
    ask(talk)
    text = [data for data in talk.sent if data not in HARMLESS]
    assert all(data.endswith((b",ID<#1;READY;", b",ID<#1;GCODE,DATA<#W95;")) for data in text)
    if talk.heard.startswith((b"\x15", b"\x06", b"\x13")):
        assert text == []


def test_noise_is_no_answer() -> None:
    class Noise(Script):
        def hear(self, seconds: float) -> bytes:
            return bytes(range(0x20, 0x100)) * 40

    talk = Talk(Noise({}))
    assert ask(talk) is None
    assert len(talk.heard) <= 2 * 8192
