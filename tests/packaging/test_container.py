"""Dockerfile, .dockerignore and compose.yaml: every path, command and variable in them exists in the repository."""

import importlib.util
import json
import re
import shutil
import subprocess
import tomllib
from fnmatch import fnmatch
from typing import Any

import pytest

from server.config.file import load
from server.config.model import Config
from tests.harness.docs import ROOT, page

PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def instructions() -> list[tuple[str, str]]:
    """The Dockerfile's instructions, continued lines joined."""
    text = (ROOT / "Dockerfile").read_text(encoding="utf-8").replace("\\\n", " ")
    lines = [line.strip() for line in text.splitlines()]
    found = [line.partition(" ") for line in lines if line and not line.startswith("#")]
    return [(name, " ".join(rest.split())) for name, _, rest in found]


def of(name: str) -> list[str]:
    return [rest for found, rest in instructions() if found == name]


def copied() -> list[str]:
    """The paths of the repository that go into the image."""
    return [source for rest in of("COPY") if "--from" not in rest for source in rest.split()[:-1]]


def test_every_path_that_is_copied_exists() -> None:
    assert [path for path in copied() if not (ROOT / path).exists()] == []


def test_everything_that_the_wheel_is_made_of_is_copied() -> None:
    wheel = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]
    needed = {*wheel["packages"], *wheel["force-include"], "pyproject.toml"}
    needed |= {PROJECT["project"]["readme"], PROJECT["project"]["license"]["file"]}
    assert set(copied()) == needed


def test_what_is_copied_is_not_ignored_and_nothing_else_is_let_in() -> None:
    lines = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    rules = [line for line in lines if line and not line.startswith("#")]
    assert rules[0] == "*"
    assert {rule.removeprefix("!") for rule in rules if rule.startswith("!")} == set(copied())
    assert not any(fnmatch(path, rule) for path in copied() for rule in rules[1:] if not rule.startswith("!"))


def test_the_interpreter_is_one_that_the_project_takes() -> None:
    (version,) = re.findall(r"PYTHON=3\.(\d+)-slim", " ".join(of("ARG")))
    (least,) = re.findall(r">=3\.(\d+)", PROJECT["project"]["requires-python"])
    assert int(version) >= int(least)
    assert all(rest.startswith("python:${PYTHON}") for rest in of("FROM"))


def test_commands_and_modules_exist() -> None:
    (entry,), (command,) = (json.loads(rest) for rest in (*of("ENTRYPOINT"), *of("CMD")))
    assert entry in PROJECT["project"]["scripts"]
    from server.cli import build

    assert command in {one.callback.__name__ for one in build().registered_commands if one.callback is not None}
    (check,) = of("HEALTHCHECK")
    python, flag, module = json.loads(check.partition("CMD ")[2])
    assert (python, flag) == ("python", "-m")
    assert importlib.util.find_spec(module) is not None
    extras = re.findall(r"\[(\w+)\]", " ".join(rest for rest in of("RUN") if "pip install" in rest))
    assert extras
    assert set(extras) <= set(PROJECT["project"]["optional-dependencies"])


def test_it_does_not_run_as_root_and_owns_its_data() -> None:
    (user,) = of("USER")
    assert int(user) > 0
    made = next(rest for rest in of("RUN") if "useradd" in rest)
    assert f"--uid {user} " in made
    assert f"--owner={user}" in made
    assert " --groups 20 " in made, "the group of the ports by its number"


def test_variables_of_the_image_are_keys() -> None:
    environ = dict(re.findall(r"(MILLSTREAM_\w+)=(\S+)", " ".join(of("ENV"))))
    config = load(None, environ)
    assert (config.server.host, str(config.server.data_dir)) == ("0.0.0.0", *of("VOLUME"))
    assert of("EXPOSE") == [str(Config().server.port)]


def compose() -> str:
    return (ROOT / "compose.yaml").read_text(encoding="utf-8")


def test_variables_of_compose_are_a_configuration() -> None:
    found = re.findall(r"^ +(MILLSTREAM_\w+): (.*)$", compose(), re.MULTILINE)
    config = load(None, {key: value.strip("\"'") for key, value in found})
    (machine,) = config.machine
    assert machine.port.startswith("/host/dev/serial/by-id/")


def test_ports_that_come_back_after_a_replug_may_be_opened() -> None:
    text = compose()
    assert "- /dev:/host/dev:ro" in text
    assert re.findall(r'- "(c \d+:\* rmw)"', text) == ["c 188:* rmw", "c 166:* rmw"]
    assert '- "8420:8420"' in text
    assert "privileged: true" not in text


def test_no_tabs_and_even_indentation() -> None:
    for line in compose().splitlines():
        assert "\t" not in line
        assert (len(line) - len(line.lstrip(" "))) % 2 == 0


def test_the_commands_that_compose_tells_of_are_documented() -> None:
    assert "token create" in page("cli.md")
    assert "docker compose run --rm millstream token create" in page("operations.md")


@pytest.mark.skipif(shutil.which("hadolint") is None, reason="no hadolint here")
def test_hadolint_finds_no_fault_in_the_dockerfile() -> None:
    said = subprocess.run(
        ["hadolint", str(ROOT / "Dockerfile")], capture_output=True, text=True, timeout=30, check=False
    )
    assert (said.returncode, said.stdout) == (0, "")
