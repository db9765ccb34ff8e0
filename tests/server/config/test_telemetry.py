"""The sections of telemetry: off by default, and what cannot work is refused before the start."""

from pathlib import Path

import pytest

from server.config.file import ConfigError, load
from server.config.model import Config

MACHINE = '[[machine]]\nname = "router"\nport = "sim:"\n'


def faults(folder: Path, text: str, **environ: str) -> list[str]:
    path = folder / "m.toml"
    path.write_text(MACHINE + text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load(path, environ)
    return [str(fault).replace(str(path), "FILE") for fault in caught.value.faults]


def test_everything_is_off_unless_it_is_switched_on() -> None:
    config = Config()
    assert [config.mtconnect.enabled, config.mqtt.enabled, config.mdns.enabled] == [False] * 3
    assert config.webhook == ()
    assert not config.mqtt.allow_commands


@pytest.mark.parametrize(
    "url",
    ["ftp://a/b", "https://", "example.com/x", "http://user:pw@host/", "https://a b/", "https://a/\n", "http://h:0/"],
)
def test_an_address_that_cannot_be_posted_to_is_refused_and_a_password_in_it_is_no_address(
    url: str, tmp_path: Path
) -> None:
    (fault,) = faults(tmp_path, f"[[webhook]]\nurl = {url!r}\n".replace("'", '"'))
    assert "webhook[0].url" in fault
    assert 'allowed is an address, "https://host/path"' in fault


def test_an_event_and_a_machine_that_do_not_exist(tmp_path: Path) -> None:
    (fault,) = faults(tmp_path, '[[webhook]]\nurl = "http://h/"\nevents = ["job.done"]\n')
    assert fault.startswith("FILE: webhook[0].events = ['job.done']: allowed is a list of job.queued, ")
    (fault,) = faults(tmp_path, '[[webhook]]\nurl = "http://h/"\nmachines = ["lathe"]\n')
    assert fault == 'FILE: webhook[0].machines = "lathe": allowed is router'
    (fault,) = faults(tmp_path, '[[webhook]]\nurl = "http://h/"\n' * 2)
    assert fault.startswith('FILE: webhook[1].url = "http://h/": allowed is an address of its own')


@pytest.mark.parametrize("prefix", ["", "a/", "/a", "a//b", "a/+", "#", "a\nb"])
def test_a_prefix_that_is_no_topic(prefix: str, tmp_path: Path) -> None:
    (fault,) = faults(tmp_path, "", MILLSTREAM_MQTT__PREFIX=prefix)
    assert fault.startswith("MILLSTREAM_MQTT__PREFIX: mqtt.prefix = ")


def test_two_passwords_and_two_secrets_are_one_too_many_and_none_is_shown(tmp_path: Path) -> None:
    two = '[mqtt]\npassword = "hunter2"\npassword_file = "/x"\n[[webhook]]\nurl = "http://h/"\n'
    found = faults(tmp_path, two + 'secret = "hunter2"\nsecret_file = "/x"\n')
    assert found == [
        "FILE: mqtt.password_file = (not shown): allowed is password or password_file, not both",
        "FILE: webhook[0].secret_file = (not shown): allowed is secret or secret_file, not both",
    ]
    (fault,) = faults(tmp_path, "[mqtt]\npassword = 4711\n")
    assert "4711" not in fault


def test_variables_reach_every_webhook_and_no_other(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(MACHINE + '[[webhook]]\nurl = "http://a/"\n', encoding="utf-8")
    environ = {
        "MILLSTREAM_WEBHOOK__0__SECRET": "s",
        "MILLSTREAM_WEBHOOK__1__URL": "http://b/",
        "MILLSTREAM_MQTT__PASSWORD": "12345678",
    }
    config = load(path, environ)
    assert [(hook.url, hook.secret) for hook in config.webhook] == [("http://a/", "s"), ("http://b/", None)]
    assert config.mqtt.password == "12345678"
    (fault,) = faults(tmp_path, "", MILLSTREAM_WEBHOOK__1__URL="http://b/")
    assert fault.endswith("no such webhook; allowed is MILLSTREAM_WEBHOOK__N__KEY, N from 0 to 0")


def test_a_name_that_is_too_long_for_the_network(tmp_path: Path) -> None:
    (fault,) = faults(tmp_path, f'[mdns]\nname = "{"ü" * 40}"\n')
    assert "a name of at most 63 bytes" in fault
