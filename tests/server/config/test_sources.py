"""Where values come from: lines of TOML in all its ways of writing, variables, defaults; and secrets are masked."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import settings as limits
from hypothesis import strategies as st

from server.config.file import ConfigError
from server.config.sources import DEFAULT, MASK, key_lines, masked, settings
from tests.harness.docs import ROOT

TEXT = """\
# a comment with [brackets] = and signs

[server]
port = 8421   # why
allowed_hosts = [
    "mill.local",   # [server]
    "mill.lan",
]

[[machine]]
name = "router"
port = "sim:"
[machine.motion]
max_rate = { x = 1000.0, y = 2000.0 }
travel.x = [0.0, 10.0]

[[machine]]
name = "lathe-1"
protocol = "ncframe"
port = "/dev/ttyUSB0"

[machine.ncframe]
semicolon = "remark"
"""


def sources(folder: Path, text: str, **environ: str) -> dict[str, str]:
    path = folder / "m.toml"
    path.write_text(text, encoding="utf-8")
    return {one.key: one.source.replace(str(path), "m.toml") for one in settings(path, environ)}


def test_each_value_with_its_line(tmp_path: Path) -> None:
    found = sources(tmp_path, TEXT)
    assert {key: source for key, source in found.items() if source != DEFAULT} == {
        "server.port": "m.toml:4",
        "server.allowed_hosts": "m.toml:5",
        "machine.router.name": "m.toml:11",
        "machine.router.port": "m.toml:12",
        "machine.router.motion.max_rate.x": "m.toml:14",
        "machine.router.motion.max_rate.y": "m.toml:14",
        "machine.router.motion.travel.x": "m.toml:15",
        "machine.lathe-1.name": "m.toml:18",
        "machine.lathe-1.protocol": "m.toml:19",
        "machine.lathe-1.port": "m.toml:20",
        "machine.lathe-1.ncframe.semicolon": "m.toml:23",
    }
    assert found["machine.router.baud"] == DEFAULT
    assert found["machine.router.motion.max_rate.z"] == DEFAULT


def test_a_variable_stands_over_the_file(tmp_path: Path) -> None:
    found = sources(
        tmp_path,
        TEXT,
        MILLSTREAM_SERVER__PORT="9000",
        MILLSTREAM_MACHINE__LATHE_1__BAUD="9600",
        MILLSTREAM_MACHINE__ROUTER__MOTION__MAX_RATE="{ x = 5.0 }",
        MILLSTREAM_URL="http://elsewhere",
    )
    assert found["server.port"] == "MILLSTREAM_SERVER__PORT"
    assert found["machine.lathe-1.baud"] == "MILLSTREAM_MACHINE__LATHE_1__BAUD"
    assert found["machine.router.motion.max_rate.y"] == "MILLSTREAM_MACHINE__ROUTER__MOTION__MAX_RATE"


def test_without_a_file_there_are_defaults_and_variables() -> None:
    found = {one.key: one.source for one in settings(None, {"MILLSTREAM_SERVER__PORT": "9000"})}
    assert set(found.values()) == {DEFAULT, "MILLSTREAM_SERVER__PORT"}
    assert not any(key.startswith("machine.") for key in found)


def test_another_protocols_keys_are_not_shown(tmp_path: Path) -> None:
    found = sources(tmp_path, TEXT)
    assert not any(key.startswith(("machine.router.grbl", "machine.lathe-1.elvinto")) for key in found)


def test_every_key_of_the_example_stands_in_its_line() -> None:
    path = ROOT / "config.example.toml"
    lines = path.read_text(encoding="utf-8").splitlines()
    found = [one for one in settings(path, {}) if one.source != DEFAULT]
    assert len(found) > 40
    for one in found:
        line = lines[int(one.source.rpartition(":")[2]) - 1]
        assert line.split("=")[0].strip() in one.key


def test_a_faulty_file_is_the_same_error_as_at_the_start(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"server\.port = 70000"):
        sources(tmp_path, "[server]\nport = 70000\n")


@pytest.mark.parametrize(
    ("text", "key", "line"),
    [
        ('a = """\n[b]\nc = 1\n"""\nd = 2', ("d",), 5),
        ("a.b.c = 1", ("a", "b", "c"), 1),
        ("[a]\n[a.b]\nc = 1", ("a", "b", "c"), 3),
        ("[[a]]\nx = 1\n[[a]]\nx = 2", ("a", 1, "x"), 4),
        ("[[a]]\n[[a.b]]\nx = 1\n[[a.b]]\nx = 2", ("a", 0, "b", 1, "x"), 5),
        ("a = [{ x = 1 }, { x = 2 }]", ("a", 1, "x"), 1),
        ("a = [1,\n[2]]\nb = 1", ("a",), 1),
        ('["a.b"]\n"c d" = 1', ("a.b", "c d"), 2),
        ("[ a . b ] # c\nx = 1", ("a", "b", "x"), 2),
        ("a = 1\r\nb = 2\r\n", ("b",), 2),
    ],
)
def test_ways_of_writing(text: str, key: tuple[Any, ...], line: int) -> None:
    tomllib.loads(text)
    assert key_lines(text)[key] == line


@limits(max_examples=40)
@given(
    st.dictionaries(st.sampled_from("abcdef"), st.one_of(st.integers(), st.booleans(), st.text("xy[]=#\n", max_size=8)))
)
def test_the_line_of_a_key_has_that_key(values: dict[str, Any]) -> None:
    text = "\n".join(f"# {key}\n{key} = {json.dumps(value)}" for key, value in values.items())
    found = key_lines(text)
    assert found == {(key,): 2 * place for place, key in enumerate(values, 1)}


@pytest.mark.parametrize(
    ("key", "value", "shown"),
    [
        ("password", "hunter2", MASK),
        ("webhook_secret", "hunter2", MASK),
        ("api_key", "hunter2", MASK),
        ("token", "", ""),
        ("password", None, None),
        ("url", "mqtt://me:hunter2@broker:1883", f"mqtt://{MASK}@broker:1883"),
        ("port", "tcp://mill:23", "tcp://mill:23"),
        ("monkey", "banana", "banana"),
        ("keys", 3, 3),
    ],
)
def test_secrets_are_masked(key: str, value: Any, shown: Any) -> None:
    assert masked(("mqtt", key), value) == shown
