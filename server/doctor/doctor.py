"""The doctor: goes through the computer, the daemon and each machine, and says what is not in order and what to do.

Not the single looks (doctor/system.py, doctor/ports.py) and not the questions to a controller (doctor/ask.py). The one
rule: nothing that it does moves a machine, and no controller is restarted unless somebody has allowed it.
"""

import json
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from typing import Any

from server.config.elvinto import ElvintoConfig
from server.config.file import ConfigError
from server.config.grbl import GrblConfig
from server.config.model import Config, MachineConfig
from server.config.ncframe import NcFrameConfig
from server.doctor.ask import ORDER, Answer, Line, ProtocolName, Talk, ask
from server.doctor.findings import Finding, Level, error, info, ok, warning
from server.doctor.line import open_line
from server.doctor.ports import Roots, kind_of, look, meddlers
from server.doctor.system import daemon_runs, system

OpenLine = Callable[..., AbstractContextManager[Line]]

SHOWN_BYTES = 300
WORKS_ALL_THE_SAME = frozenset(
    {("require_header", True), ("counter", True), ("firmware", "grblhal"), ("firmware", "grbl-1.1")}
)
"""What a controller shows that the configuration does not know of, and that is only not made use of."""
DEFAULTS = {"elvinto": ElvintoConfig(), "grbl": GrblConfig(), "ncframe": NcFrameConfig()}


@dataclass(frozen=True, slots=True)
class Doctor:
    """How to look: `allow_reset`: serial ports may be opened although that restarts an Arduino. `open_line` and
    `roots` are the computer's; tests hand in their own."""

    allow_reset: bool = False
    open_line: OpenLine = open_line
    roots: Roots = field(default_factory=Roots)

    def examine(self, config: Config) -> Iterator[Finding]:
        """Everything that a configuration names."""
        yield from system(config)
        if not config.machine:
            yield warning("config", "No machine is configured.", "Add a [[machine]]; `millstream ports` lists ports.")
        if any(kind_of(machine.port) == "device" for machine in config.machine):
            yield from meddlers(self.roots)
        running = daemon_runs(config)
        for machine in config.machine:
            for finding in self._machine(machine, running=running):
                yield replace(finding, machine=machine.name)

    def examine_port(self, port: str, baud: int, protocol: ProtocolName | None) -> Iterator[Finding]:
        """A port of which nothing is known, or the protocol alone."""
        yield from (
            look(port, self.roots) if kind_of(port) != "device" else (*look(port, self.roots), *meddlers(self.roots))
        )
        yield from self._ask(port, baud, protocols=ORDER if protocol is None else (protocol,))

    def _machine(self, machine: MachineConfig, *, running: bool) -> Iterator[Finding]:
        if kind_of(machine.port) == "sim":
            yield ok("port", "It is a built-in virtual machine.")
            return
        if running:
            # Two that speak on one line get half of the answers each.
            yield info(
                "controller", "Not asked: the daemon has its port.", "`millstream machines` shows what it knows."
            )
            return
        found = list(look(machine.port, self.roots))
        yield from found
        if any(finding.level is Level.ERROR for finding in found):
            return
        protocol: Any = machine.protocol
        silent = machine.protocol == "grbl" and not machine.grbl.resets_on_open
        yield from self._ask(machine.port, machine.baud, protocols=(protocol,), machine=machine, silent=silent)

    def _ask(
        self,
        port: str,
        baud: int,
        *,
        protocols: tuple[ProtocolName, ...],
        machine: MachineConfig | None = None,
        silent: bool = False,
    ) -> Iterator[Finding]:
        """`silent`: opening the port is known to restart nothing."""
        kind = kind_of(port)
        if kind in ("none", "sim"):
            return
        if kind == "device" and not (silent or self.allow_reset):
            yield info(
                "controller",
                f"Not asked: opening {port} raises DTR, which restarts an Arduino.",
                "Where that does no harm: --allow-reset.",
            )
            return
        dtr = machine.dtr if machine is not None else True
        try:
            with self.open_line(port, baud, dtr=dtr) as line:
                talk = Talk(line)
                answer = ask(talk, protocols, restarts=kind == "device" and not silent)
        except OSError as fault:
            yield error("controller", f"{port} cannot be opened: {fault}.", "Is it held by somebody, or gone?")
            return
        yield from _told(answer, talk, port, baud, protocols, machine)


def config_faults(fault: ConfigError) -> Iterator[Finding]:
    """What is wrong with a configuration that cannot be used."""
    for one in fault.faults:
        message = f"{one.source}: {one.key} = {one.value}"
        yield error("config", message, one.advice, source=one.source, key=one.key)
    if not fault.faults:
        yield error("config", str(fault), "docs/configuration.md has every key.")


def _told(
    answer: Answer | None,
    talk: Talk,
    port: str,
    baud: int,
    protocols: tuple[ProtocolName, ...],
    machine: MachineConfig | None,
) -> Iterator[Finding]:
    """The answer as findings; with what was sent, so that nobody has to wonder."""
    data: dict[str, Any] = {
        "sent": [sent.hex(" ") if len(sent) < 2 else sent.decode("latin-1") for sent in talk.sent],
        "heard": talk.heard[:SHOWN_BYTES].decode("latin-1").encode("unicode_escape").decode("ascii"),
    }
    if answer is None:
        heard = f'It said "{data["heard"]}".' if talk.heard else "It said nothing."
        yield error(
            "controller",
            f"Nobody answered on {port} at {baud} baud in {' or '.join(protocols)}. {heard}",
            "Is the controller on, the baud rate right (`--baud`), RX and TX not exchanged? "
            "One that executes something, or is in alarm, may answer nothing.",
            **data,
        )
        return
    data |= {"protocol": answer.protocol, "says": answer.says, "dialect": dict(answer.dialect)}
    data["config"] = configuration(answer, port, baud)
    wrong = {} if machine is None else _differences(answer, machine)
    if wrong:
        keys = ", ".join(f"{key} = {_toml(value)}" for key, value in wrong.items())
        advice = f"Set {keys} in [machine.{answer.protocol}]."
        found = warning if set(wrong.items()) <= WORKS_ALL_THE_SAME else error
        yield found("controller", f"It answers ({answer.says}), but not as configured.", advice, **data)
    else:
        yield ok("controller", f"It answers: {answer.protocol}, {answer.says}.", **data)
    if answer.unsure:
        yield info(
            "controller", f"What it said does not tell {', '.join(answer.unsure)}.", "See docs/configuration.md."
        )


def _differences(answer: Answer, machine: MachineConfig) -> dict[str, Any]:
    """The keys that are configured otherwise than the controller has shown itself, as they ought to be."""
    present = machine.dialect
    told = {key: value for key, value in answer.dialect.items() if key not in ("resets_on_open", *answer.unsure)}
    return {key: value for key, value in told.items() if getattr(present, key) != value}


def configuration(answer: Answer, port: str, baud: int) -> str:
    """The machine's section of the configuration, with what differs from the defaults."""
    lines = ["[[machine]]", 'name = "machine-1"', f'protocol = "{answer.protocol}"', f"port = {_toml(port)}"]
    if not port.startswith("tcp://"):
        lines.append(f"baud = {baud}")
    default = DEFAULTS[answer.protocol]
    differing = {
        key: value
        for key, value in answer.dialect.items()
        if key not in answer.unsure and getattr(default, key) != value
    }
    if differing:
        lines += ["", f"[machine.{answer.protocol}]", *(f"{key} = {_toml(value)}" for key, value in differing.items())]
    return "\n".join(lines)


def _toml(value: Any) -> str:
    """A basic string, a boolean or a number is written alike in TOML and in JSON."""
    return json.dumps(value, ensure_ascii=False)
