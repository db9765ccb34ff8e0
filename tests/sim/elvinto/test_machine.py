"""The machine on its wire: what it accepts, what it answers and in which order, what it forgets."""

import base64
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.elvinto.events import AlarmRaised, Booted, CommandAccepted, CommandEnded, MessageDropped, PowerLost
from sim.elvinto.gcode import (
    ERR_NO_CARD,
    ERR_NO_FILE,
    ERR_PARAMETER,
    ERR_UNKNOWN_CODE,
    ERR_UNKNOWN_COMMAND,
)
from sim.elvinto.machine import VirtualElvinto
from sim.elvinto.settings import SimSettings
from tests.harness.elvinto_peer import Peer, fields, frame, names

INSTANT = SimSettings(instant=True)
REACK = replace(INSTANT, repeat="reack")
SLOW = SimSettings(rapid_mm_min=6000.0, acceleration=500.0)


def peer(settings: SimSettings = INSTANT) -> Peer:
    return Peer(VirtualElvinto(settings))


# What gets in.


def test_a_command_is_received_and_then_done() -> None:
    host = peer()
    assert host.batch(1001, "G0X1", "G0X2") == ["RECEIVED,ID<#1001;", "OK,ID<#1001;"]
    assert host.blocks == ["G0X1", "G0X2"]
    assert [block.id for block in host.machine.executed] == [1001, 1001]
    assert all(block.finished for block in host.machine.executed)
    assert host.machine.last_id == 1001


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"GCODE,DATA<#G28;", "no_header"),
        (frame("READY;", 1)[:-6] + b"GCODE,DATA<#G28;", "checksum"),
        (frame("GCODE,DATA<#G28;", 1).replace(b"VALUE<#2022", b"VALUE<#2023"), "checksum"),
        (frame("GCODE,DATA<#G28;", 1).replace(b"MD5<#8d", b"MD5<#8e"), "checksum"),
        (frame("GCODE,DATA<#G28;", 1, name="CRC"), "no_header"),
        (frame("GCODE,DATA<#G28;"), "no_id"),
        (frame("RESETALERT;"), "no_id"),
        (frame("INIT;"), "no_id"),
        (frame("GCODE,DATA<%;", 1), "malformed"),
        (frame("GCODE,DATA<#1,DATA<#2;", 1), "malformed"),
        (frame("GCODE,DATA<#" + "G1X1|" * 2000 + ";", 1), "overlong"),
    ],
)
def test_what_is_not_let_in(data: bytes, reason: str) -> None:
    host = peer()
    host.machine.receive_data(data, 0.0)
    assert host.heard() == []
    assert host.blocks == []
    assert host.machine.last_id == 0
    assert host.machine.dropped[reason] >= 1
    dropped = [event.reason for event in iter(host.machine.next_event, None) if isinstance(event, MessageDropped)]
    assert reason in dropped


def test_a_header_is_good_for_the_next_message_only() -> None:
    host = peer()
    good = frame("GCODE,DATA<#G0X1;", 1)
    header, body = good.split(b";")[0] + b";", b"GCODE,DATA<#G0X1;"
    host.machine.receive_data(header + b"NOISE;" + body, 0.0)
    host.machine.receive_data(header + b"x" * 9000 + b";" + body, 0.0)
    host.machine.receive_data(header + header[:-9] + b"<;" + body, 0.0)
    assert host.blocks == []
    host.machine.receive_data(header + header + b"\r\n" + body + body, 0.0)
    assert host.blocks == ["G0X1"]


@pytest.mark.parametrize(
    "settings",
    [
        SimSettings(instant=True, header_name="CRC", crc_radix=16),
        SimSettings(instant=True, header_name="CRC", crc_radix=16, checksum_scope="gcode"),
    ],
)
def test_other_dialects(settings: SimSettings) -> None:
    host = peer(settings)
    wire = frame("GCODE,DATA<#G28;", 11, name="CRC", radix=16)
    if settings.checksum_scope == "gcode":
        wire = frame("G28;", 11, name="CRC", radix=16).removesuffix(b"G28;") + b"GCODE,DATA<#G28;"
    host.machine.receive_data(wire, 0.0)
    assert host.heard() == ["RECEIVED,ID<#11;", "OK,ID<#11;"]


def test_a_batch_as_base64() -> None:
    host = peer()
    data = base64.b64encode(b"G0X1|G0X2").decode()
    assert names(host.tell(f"GCODE,DATA<{data};", 1)) == ["RECEIVED", "OK"]
    assert host.blocks == ["G0X1", "G0X2"]


@given(st.lists(st.binary(max_size=60), max_size=10), st.booleans())
@settings(max_examples=60)
def test_any_bytes_raise_nothing(chunks: list[bytes], framed: bool) -> None:
    machine = VirtualElvinto(INSTANT)
    for index, chunk in enumerate(chunks):
        data = frame(chunk.decode("latin-1").replace(";", "") + ";", index + 1) if framed else chunk
        machine.receive_data(data, float(index))
        machine.data_to_send(float(index))


@given(st.lists(st.integers(0, 400), max_size=10))
def test_chunking_does_not_matter(cuts: list[int]) -> None:
    stream = frame("INIT;", 7) + frame("READY;") + frame("GCODE,DATA<#G0X1|G4;", 8) + frame("GCODE,DATA<#W95;", 9)
    whole, pieced = peer(), peer()
    whole.machine.receive_data(stream, 0.0)
    edges = sorted({0, len(stream), *(min(cut, len(stream)) for cut in cuts)})
    said: list[str] = []
    for start, end in pairwise(edges):
        pieced.machine.receive_data(stream[start:end], 0.0)
        said += pieced.heard()
    assert said == whole.heard()


# IDs.


def test_silent_machine_ignores_a_repeated_id() -> None:
    host = peer()
    host.batch(5, "G0X1")
    assert host.batch(5, "G0X1") == []
    assert host.batch(4, "G0X2") == []
    assert host.blocks == ["G0X1"]
    assert host.machine.dropped["repeated"] == 2


def test_reacking_machine_answers_a_repeated_id_without_executing_it() -> None:
    host = peer(REACK)
    host.batch(5, "G0X1")
    assert host.batch(5, "G0X1") == ["RECEIVED,ID<#5;", "OK,ID<#5;"]
    assert host.batch(1, "W95") == ["RECEIVED,ID<#1;", "OK,ID<#1;"], "no STATE: it is not executed"
    assert host.blocks == ["G0X1"]
    host.batch(6, "G4")
    assert host.batch(6, "G4") == ["RECEIVED,ID<#6;", f"ERROR,ID<#6,NUM<#{ERR_UNKNOWN_CODE};"]
    assert host.batch(5, "G0X1") == ["RECEIVED,ID<#5;", "OK,ID<#5;"]


def test_any_higher_id_is_accepted_and_zero_never() -> None:
    host = peer()
    assert host.batch(0, "G0X9") == []
    assert names(host.batch(10, "G0X1")) == ["RECEIVED", "OK"]
    assert names(host.batch(999_999, "G0X2")) == ["RECEIVED", "OK"]


def test_init_is_accepted_with_any_id_and_forgets_the_last() -> None:
    host = peer()
    host.batch(5000, "G0X1")
    assert host.tell("INIT;", 3) == ["RECEIVED,ID<#3;", "OK,ID<#3;"]
    assert host.machine.last_id == 0
    assert names(host.batch(1, "G0X2")) == ["RECEIVED", "OK"]
    assert host.machine.position["X"] == 2


def test_init_that_is_not_acknowledged() -> None:
    host = peer(replace(INSTANT, init_acknowledged=False))
    host.batch(5, "G0X1")
    assert host.tell("INIT;") == []
    assert host.machine.last_id == 0


def test_ready_is_answered_and_does_not_touch_the_memory_of_ids() -> None:
    host = peer()
    host.batch(5, "G0X1")
    assert host.tell("READY;") == ["READY;"]
    assert host.tell("READY;", 900) == ["READY;"]
    assert host.machine.last_id == 5


@pytest.mark.parametrize("end", ["M30", "M99"])
def test_the_end_of_a_program_forgets_the_last_id(end: str) -> None:
    host = peer(REACK)
    assert host.batch(8, end) == ["RECEIVED,ID<#8;", "OK,ID<#8;"]
    assert host.machine.last_id == 0
    host.batch(8, end)
    assert host.blocks == [end, end], "the same bytes again are executed again (elvinto §5.6)"


# Execution in time.


def test_ok_comes_when_the_motion_is_over() -> None:
    host = peer(SLOW)
    assert host.batch(1, "G0X100", "G0X0") == ["RECEIVED,ID<#1;"]
    assert host.machine.status == "run"
    assert host.wait(2.39) == []
    assert host.machine.executed[0].ended_at == pytest.approx(1.2)
    assert host.machine.executed[1].at == pytest.approx(1.2)
    assert host.wait(0.02) == ["OK,ID<#1;"]
    assert host.machine.status == "idle"


@pytest.mark.parametrize("repeat", ["silent", "reack"])
def test_nothing_else_is_accepted_while_running(repeat: str) -> None:
    host = peer(replace(SLOW, repeat=repeat))
    host.batch(4, "G0X1")
    host.settle()
    host.batch(5, "G0X100")
    assert host.batch(6, "G0X2") == []
    assert host.batch(4, "G0X1") == []
    assert host.tell("INIT;", 7) == []
    assert host.tell("READY;") == []
    assert host.tell("READDIR;") == []
    assert host.tell("RESETALERT;", 9) == []
    assert host.batch(5, "G0X100") == (["RECEIVED,ID<#5;"] if repeat == "reack" else [])
    assert host.settle() == ["OK,ID<#5;"]
    assert host.blocks == ["G0X1", "G0X100"]


def test_an_unknown_code_ends_the_batch_where_it_stands() -> None:
    host = peer()
    assert host.batch(1, "G0X1", "G4P1", "G0X3") == ["RECEIVED,ID<#1;", f"ERROR,ID<#1,NUM<#{ERR_UNKNOWN_CODE};"]
    assert host.blocks == ["G0X1"]
    assert names(host.batch(2, "G0X5")) == ["RECEIVED", "OK"]


def test_commands_that_it_does_not_understand_are_errors() -> None:
    host = peer()
    assert host.tell("DANCE;", 1)[1] == f"ERROR,ID<#1,NUM<#{ERR_UNKNOWN_COMMAND};"
    assert host.tell("GCODE,TEXT<#G0;", 2)[1] == f"ERROR,ID<#2,NUM<#{ERR_PARAMETER};"
    assert host.tell("RUN;", 3)[1] == f"ERROR,ID<#3,NUM<#{ERR_PARAMETER};"


def test_speed_factor_divides_time() -> None:
    host = peer(replace(SLOW, speed_factor=10.0))
    host.batch(1, "G0X100")
    assert host.machine.next_timer() == pytest.approx(0.12)


def test_one_late_timer_does_all_that_was_due() -> None:
    host = peer(SLOW)
    host.batch(1, "W90")
    host.batch(2, "G0X100", "G0X0")
    said = host.wait(100.0)
    assert names(said)[-3:] == ["STATE", "OK", "STATE"]
    ends = [block.ended_at for block in host.machine.executed[1:]]
    assert ends == pytest.approx([1.2, 2.4])


# STATE.


def test_w95_is_answered_between_received_and_ok() -> None:
    host = peer()
    host.batch(1, "G0X1.5Y-2", "G1Z3F250", "M3S12000", "G91")
    received, state, done = host.batch(2, "W95")
    assert (received, done) == ("RECEIVED,ID<#2;", "OK,ID<#2;")
    assert fields(state) == {
        "TYPE": "idle",
        "MX": "1.5",
        "MY": "-2",
        "MZ": "3",
        "MA": "0",
        "MB": "0",
        "MC": "0",
        "FEED": "250",
        "SPEED": "12000",
        "ISABS": "N",
    }


def test_queries_within_a_batch_say_run() -> None:
    host = peer()
    assert fields(host.batch(1, "G0X1", "W95", "G0X2")[1])["TYPE"] == "run"


def test_w96_and_w97_are_answered() -> None:
    host = peer()
    assert names(host.batch(1, "W96", "W97")) == ["RECEIVED", "SWITCHES", "MACHINE", "OK"]


def test_state_while_moving_only_after_w90() -> None:
    host = peer(replace(SLOW, state_interval_s=0.25))
    host.batch(1, "G0X100")
    assert names(host.settle()) == ["OK"]
    host.batch(2, "W90")
    said = host.batch(3, "G0X0")[1:] + host.settle()
    assert names(said) == ["STATE"] * 5 + ["OK", "STATE"]
    places = [float(fields(message)["MX"]) for message in said if message.startswith("STATE")]
    assert places == sorted(places, reverse=True)
    assert places[-1] == 0
    assert fields(said[0])["TYPE"] == "run"
    assert fields(said[-1])["TYPE"] == "idle"
    host.batch(4, "W91")
    host.batch(5, "G0X100")
    assert names(host.settle()) == ["OK"]


def test_state_comes_over_a_row_of_short_batches_too() -> None:
    host = peer(replace(SLOW, state_interval_s=0.5))
    host.batch(1, "W90")
    said: list[str] = []
    for wire_id in range(2, 42):
        host.batch(wire_id, f"G0X{wire_id}")
        while host.machine.status == "run":
            said += host.settle(0.05)
    assert 5 < names(said).count("STATE") < 12


def test_idle_is_said_as_often_as_set() -> None:
    host = peer(replace(SLOW, idle_reports=3))
    host.batch(1, "W90")
    host.batch(2, "G0X1")
    assert names(host.settle())[-4:] == ["OK", "STATE", "STATE", "STATE"]
    assert host.machine.next_timer() is None


def test_state_as_the_standard_prints_it() -> None:
    host = peer(replace(INSTANT, literal_state=True))
    host.batch(1, "W72")
    state = host.batch(2, "G0X-1")[1]
    assert state.startswith("STATE, TYPE<#axisalarm, MX<#0,")
    assert "SPEED<#0 ALARMNUM<#5, AXISNUM<#1, ISABS<#Y;" in state


# Alarms.


def test_the_border_of_the_field_stops_the_batch_without_ok() -> None:
    host = peer(SLOW)
    host.batch(1, "W72")
    host.batch(2, "G0X10", "G0X900", "G0X20")
    said = host.settle(30.0)
    assert set(names(said)) == {"STATE"}
    state = fields(said[0])
    assert (state["TYPE"], state["ALARMNUM"], state["AXISNUM"], state["MX"]) == ("axisalarm", "6", "1", "800")
    assert host.blocks == ["W72", "G0X10", "G0X900"]
    assert [block.finished for block in host.machine.executed] == [True, True, False]


@pytest.mark.parametrize("repeat", ["silent", "reack"])
def test_in_alarm_nothing_is_answered_but_resetalert(repeat: str) -> None:
    host = peer(replace(INSTANT, repeat=repeat))
    host.batch(1, "W72")
    host.batch(10, "G0X-1")
    for wire_id in (10, 3, 11):
        assert host.batch(wire_id, "W95") == []
    assert host.tell("INIT;", 12) == []
    assert host.tell("READY;") == []
    assert names(host.tell("RESETALERT;", 10)) == (["RECEIVED", "OK"] if repeat == "reack" else [])
    assert host.machine.status == "axisalarm"
    said = host.tell("RESETALERT;", 13)
    assert names(said) == ["RECEIVED", "OK", "STATE"]
    assert fields(said[2])["TYPE"] == "idle"
    assert host.machine.last_id == 13
    assert names(host.batch(14, "G0X1")) == ["RECEIVED", "OK"]


def test_the_alarm_is_said_again_until_it_is_cleared() -> None:
    host = peer(replace(INSTANT, alarm_repeat_s=2.0))
    host.machine.press_emergency(0.0)
    assert fields(host.heard()[0])["ALARMNUM"] == "100"
    assert names(host.settle(5.0)) == ["STATE", "STATE"]
    host.tell("RESETALERT;", 1)
    assert host.settle() == []


def test_the_alarm_is_said_once_when_so_set() -> None:
    host = peer(replace(INSTANT, alarm_repeat_s=0.0))
    host.machine.press_emergency(0.0)
    assert names(host.heard()) == ["STATE"]
    assert host.machine.next_timer() is None


def test_a_machine_that_talks_in_alarm() -> None:
    host = peer(replace(INSTANT, init_in_alarm=True))
    host.machine.press_emergency(0.0)
    host.heard()
    assert names(host.tell("INIT;", 1)) == ["RECEIVED", "OK"]
    assert host.tell("READY;") == ["READY;"]
    assert fields(host.batch(2, "W95")[1])["TYPE"] == "cnscalarm"
    assert host.batch(3, "G0X1") == []
    assert host.batch(3, "W95", "G0X1") == []


def test_the_emergency_button_stops_in_the_middle_of_a_block() -> None:
    host = peer(SLOW)
    host.batch(1, "G0X100", "G0X0")
    host.wait(0.6)
    host.machine.press_emergency(host.now)
    state = fields(host.heard()[0])
    assert (state["TYPE"], state["MX"]) == ("cnscalarm", "50")
    assert host.machine.position["X"] == pytest.approx(50)
    assert host.machine.true_position["X"] == pytest.approx(50)
    assert not host.machine.executed[0].finished
    host.tell("RESETALERT;", 2)
    host.batch(3, "G91", "G0X1")
    host.settle(5.0)
    assert host.machine.position["X"] == pytest.approx(51)


def test_w98_is_the_button_and_is_obeyed_while_running() -> None:
    host = peer(SLOW)
    host.batch(1, "G0X100")
    host.wait(0.6)
    assert host.batch(1, "W98") == [], "only under a new ID"
    assert host.batch(2, "G0X5|W98") == [], "only alone"
    said = host.batch(2, "W98")
    assert names(said) == ["RECEIVED", "STATE"]
    assert fields(said[1])["ALARMNUM"] == "100"
    assert host.blocks == ["G0X100", "W98"]
    assert host.machine.last_id == 2
    assert "OK" not in names(host.settle(10.0))


def test_w98_while_idle_and_where_it_is_not_obeyed_while_running() -> None:
    host = peer()
    assert names(host.batch(1, "W98")) == ["RECEIVED", "STATE"]
    deaf = peer(replace(SLOW, estop_while_running=False))
    deaf.batch(1, "G0X100")
    assert deaf.batch(2, "W98") == []
    assert deaf.machine.status == "run"


def test_limit_switches_are_watched_while_homing_only() -> None:
    host = peer(replace(SLOW, start_position=(100.0, 100.0, 0.0)))
    host.batch(1, "G0X200")
    assert not host.machine.trip_limit("x", "end", 0.1)
    host.settle()
    host.batch(2, "G28")
    assert host.machine.trip_limit("Y", "end", host.now + 0.1)
    state = fields(host.heard()[0])
    assert (state["TYPE"], state["ALARMNUM"], state["AXISNUM"]) == ("axisalarm", "2", "2")


@pytest.mark.parametrize(("end", "num"), [("start", "3"), ("end", "4")])
def test_a_faulty_switch_is_noticed_by_the_next_homing(end: str, num: str) -> None:
    host = peer()
    assert not host.machine.trip_limit("Z", "start" if end == "start" else "end", 0.0, faulty=True)
    state = fields(host.batch(1, "G29")[1])
    assert (state["ALARMNUM"], state["AXISNUM"]) == (num, "3")
    host.tell("RESETALERT;", 2)
    assert names(host.batch(3, "G28")) == ["RECEIVED", "OK"]


# Tools and the card.


def test_a_tool_change_is_reported_after_the_lift() -> None:
    host = peer(SLOW)
    assert names(host.batch(1, "T3", "M06")) == ["RECEIVED"]
    assert host.settle() == ["TOOL,NUM<#3;", "OK,ID<#1;"]
    assert host.machine.position["Z"] == SLOW.safe_z
    assert host.tell("CHECKCHANGETOOL;") == ["TOOL,NUM<#3;"]
    host.batch(2, "W95")
    assert host.tell("CHECKCHANGETOOL;") == ["TOOL,NUM<#3;"]
    host.batch(3, "M3S1000")
    assert host.tell("CHECKCHANGETOOL;") == []


def test_a_machine_that_waits_for_its_button_at_a_tool_change() -> None:
    host = peer(replace(SLOW, tool_change="wait"))
    host.batch(1, "M6T7", "G0X1")
    assert host.settle() == ["TOOL,NUM<#7;"]
    assert host.machine.status == "run"
    assert host.tell("CHECKCHANGETOOL;") == ["TOOL,NUM<#7;"]
    assert host.batch(2, "G0X9") == []
    host.machine.confirm_tool(host.now)
    assert names(host.settle()) == ["OK"]
    assert host.blocks == ["M6T7", "G0X1"]


def test_the_listing_of_the_card() -> None:
    card = {"part1.nc": b"", "деталь, 1.nc": b""}
    said = peer(replace(INSTANT, sd_files=card)).tell("READDIR;")
    assert names(said) == ["SDD_OK", "DIR_BEGIN", "FILE", "FILE", "DIR_END"]
    assert said[2] == "FILE,NAME<#part1.nc;"
    assert base64.b64decode(said[3].removeprefix("FILE,NAME<").removesuffix(";")).decode() == "деталь, 1.nc"
    assert names(peer(replace(INSTANT, dir_end="END_BEGIN")).tell("READDIR;"))[-1] == "END_BEGIN"
    assert peer(replace(INSTANT, sd_files=None)).tell("READDIR;") == ["SDD_NO;"]
    assert fields(peer(replace(INSTANT, sd_fs="NO")).tell("READDIR;")[0])["ROOT"] == "NO"


def test_a_program_from_the_card() -> None:
    content = b"%\nN10 G0X10 (go)\nG0X0\nM30\nG0X99\n"
    host = peer(replace(SLOW, sd_files={"деталь.nc": content}))
    name = base64.b64encode("деталь.nc".encode()).decode()
    assert names(host.tell(f"RUN,NAME<{name};", 5))[0] == "RECEIVED"
    assert host.machine.status == "run"
    said = host.settle()
    assert {"STATE", "PROGRAM_END", "OK"} == set(names(said))
    assert [name for name in names(said) if name != "STATE"] == ["PROGRAM_END", "OK"]
    assert host.blocks == ["G0X10", "G0X0", "M30"]
    assert host.machine.last_id == 0


def test_programs_that_cannot_be_run() -> None:
    host = peer(replace(INSTANT, sd_files={"bad.nc": b"G0X1\nG4P1\n"}))
    assert host.tell("RUN,NAME<#none.nc;", 1)[1] == f"ERROR,ID<#1,NUM<#{ERR_NO_FILE};"
    assert host.tell("RUN,NAME<#bad.nc;", 2)[1] == f"ERROR,ID<#2,NUM<#{ERR_UNKNOWN_CODE};"
    no_card = peer(replace(INSTANT, sd_files=None))
    assert no_card.tell("RUN,NAME<#a.nc;", 1)[1] == f"ERROR,ID<#1,NUM<#{ERR_NO_CARD};"


# Power.


def test_a_restart_forgets_everything_but_the_place_of_the_carriage() -> None:
    host = peer(SLOW)
    host.batch(1, "W90", "W72", "G91")
    host.batch(2, "G0X100", "G0X100")
    host.wait(0.6)
    host.machine.receive_data(frame("GCODE,DATA<#G0X5;", 3)[:40], host.now)
    host.machine.restart(host.now)
    assert host.heard() == [], "what was not sent yet is lost"
    assert host.machine.status == "boot"
    assert host.batch(4, "G0X1") == [], "deaf while booting"
    assert host.settle() == ["READY;"]
    assert host.machine.last_id == 0
    assert host.machine.position["X"] == 0
    assert host.machine.true_position["X"] == pytest.approx(50)
    assert host.machine.mill.absolute
    assert names(host.batch(1, "G0X1")) == ["RECEIVED"]
    assert names(host.settle()) == ["OK"]
    assert host.blocks[-2:] == ["G0X100", "G0X1"]


def test_power_off_and_on() -> None:
    host = peer(replace(INSTANT, boot_s=2.0))
    host.machine.power_off(0.0)
    assert host.machine.status == "off"
    assert host.batch(1, "G0X1") == []
    assert host.settle() == []
    host.machine.press_emergency(0.0)
    assert host.machine.status == "off"
    host.machine.power_on(host.now)
    host.machine.power_on(host.now)
    assert host.machine.next_timer() == 2.0
    assert host.settle() == ["READY;"]


def test_a_restart_ends_an_alarm() -> None:
    host = peer()
    host.machine.press_emergency(0.0)
    host.machine.restart(0.0)
    assert host.settle() == ["READY;"]
    assert host.machine.status == "idle"


def test_events_tell_the_story() -> None:
    host = peer()
    host.batch(1, "G0X1")
    host.machine.press_emergency(0.0)
    host.machine.restart(1.0)
    host.settle()
    kinds = [type(event) for event in iter(host.machine.next_event, None)]
    assert kinds[0] is CommandAccepted
    assert [kind for kind in kinds if kind in (CommandEnded, AlarmRaised, PowerLost, Booted)] == [
        CommandEnded,
        AlarmRaised,
        PowerLost,
        Booted,
    ]


def test_the_record_can_be_bounded_and_followed() -> None:
    noted: list[str] = []
    machine = VirtualElvinto(
        replace(INSTANT, executed_limit=10), on_block=lambda block: noted.append(f"{block.id} {block.text}")
    )
    host = Peer(machine)
    for wire_id in range(1, 101):
        host.batch(wire_id, f"G0X{wire_id}")
    assert machine.executed_count == 100
    assert 10 <= len(machine.executed) <= 20
    assert host.blocks[-1] == "G0X100"
    assert noted == [f"{wire_id} G0X{wire_id}" for wire_id in range(1, 101)]
