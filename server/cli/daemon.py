"""The daemon as the commands see it: HTTP requests that either answer or end the command with a reason.

Not the daemon itself (serve.py). The one rule: whoever calls gets JSON or a CliError: code 3 where no millstream
answers, code 1 with title and detail where it refuses.
"""

import os
import secrets
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self
from urllib.parse import quote

import httpx
import typer

from server.cli.common import CliError, ExitCode, safe, warn

API = "/api/v1"
CHUNK_BYTES = 64 * 1024
TIMEOUT = httpx.Timeout(60.0, connect=5.0)
"""An answer may wait for a check of a large program; a connection on a LAN may not."""
KEYED_TURNS = 60
"""Times TIMEOUT: an hour. A million lines are checked in some 10 s."""
SHOWN_FINDINGS = 20
HINTS = {
    "unauthorized": "Set MILLSTREAM_TOKEN; the daemon's owner makes one with `millstream token create`.",
    "preflight_warnings": "Here: `millstream submit --force`.",
    "needs_force": "Here: --force.",
    "control_held": "Here: `millstream control --takeover`.",
}
"""What a refusal means for somebody at the command line."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What a command finds around itself; tests hand in their own. `transport` None is the network."""

    environ: Mapping[str, str] = field(default_factory=lambda: os.environ)
    transport: httpx.BaseTransport | None = None


def surroundings(ctx: typer.Context) -> Surroundings:
    """Those that `main` was started with."""
    found = ctx.find_object(Surroundings)
    return Surroundings() if found is None else found


class Daemon:
    """A connection to a running daemon; use with `with`."""

    def __init__(self, url: str, around: Surroundings) -> None:
        parts = httpx.URL(url)
        if parts.scheme not in ("http", "https") or not parts.host:
            raise CliError(ExitCode.USAGE, f"--url {safe(url)}: an address begins with http:// or https://")
        self.url = url.rstrip("/")
        self.token = around.environ.get("MILLSTREAM_TOKEN")
        headers = {"Authorization": f"Bearer {self.token}"} if self.token else {}
        # A transport of our own, because httpx would ask a proxy of the environment for the machine next door.
        transport = around.transport or httpx.HTTPTransport()
        self._http = httpx.Client(base_url=self.url + API, headers=headers, timeout=TIMEOUT, transport=transport)

    @classmethod
    def of(cls, ctx: typer.Context, url: str) -> Self:
        """The daemon that a command was told to talk to."""
        return cls(url, surroundings(ctx))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._http.close()

    def get(self, path: str, **params: str | int | None) -> Any:
        """GET; parameters that are None are left out."""
        return self._request("GET", path, params={key: value for key, value in params.items() if value is not None})

    def post(self, path: str, body: Mapping[str, Any] | None = None) -> Any:
        """POST a JSON body, or none."""
        return self._request("POST", path, json=body)

    def post_once(self, path: str, body: Mapping[str, Any], *, waiting: str) -> Any:
        """POST what must not be done twice and may take long: asked again under the same key while the daemon is at it.
        `waiting` is said the first time."""
        headers = {"Idempotency-Key": secrets.token_hex(16)}
        for turn in range(KEYED_TURNS):
            try:
                return self._request("POST", path, json=body, headers=headers)
            except CliError as error:
                if not isinstance(error.__cause__, httpx.ReadTimeout) or turn == KEYED_TURNS - 1:
                    raise
            if turn == 0:
                warn(waiting)
        raise AssertionError

    def patch(self, path: str, body: Mapping[str, Any]) -> Any:
        """PATCH a JSON body."""
        return self._request("PATCH", path, json=body)

    def put(self, path: str, body: Mapping[str, Any]) -> Any:
        """PUT a JSON body."""
        return self._request("PUT", path, json=body)

    def delete(self, path: str) -> Any:
        """DELETE."""
        return self._request("DELETE", path)

    def upload(self, path: Path, name: str) -> Any:
        """Hand in a program; the file is read in pieces."""
        headers = {"Content-Length": str(path.stat().st_size), "Content-Type": "application/octet-stream"}
        return self._request("POST", "/programs", params={"name": name}, headers=headers, content=_chunks(path))

    def only_machine(self, name: str | None) -> str:
        """`name`, or the one machine that there is."""
        return name if name is not None else _only([machine["name"] for machine in self.get("/machines")])

    def _request(self, method: str, path: str, **rest: Any) -> Any:
        try:
            response = self._http.request(method, path, **rest)
        except httpx.ConnectError as error:
            raise unreachable(self.url, "no daemon answers") from error
        except httpx.TimeoutException as error:
            raise unreachable(self.url, "the daemon does not answer in time") from error
        except httpx.TransportError as error:
            raise unreachable(self.url, f"the connection broke ({safe(error)})") from error
        return _answer(response, self.url)


def machine_path(name: str, action: str = "") -> str:
    """The path of a machine, whatever is in its name."""
    return f"/machines/{quote(name, safe='')}{action}"


def unreachable(url: str, why: str) -> CliError:
    """No millstream there."""
    return CliError(
        ExitCode.UNREACHABLE,
        f"{safe(url)}: {why}. Start one with `millstream serve`, or say where it runs: --url or MILLSTREAM_URL.",
        {"code": "unreachable", "detail": why, "url": url},
    )


def told_setting(one: Mapping[str, Any]) -> str:
    """What became of a setting that was to be written."""
    words = f"${one['number']} {one['name'] or ''}".strip()
    match one["status"]:
        case "written":
            return safe(f"{words}: {one['before']} -> {one['value']}")
        case "unchanged":
            return safe(f"{words}: {one['value']} as before")
        case _:
            return safe(f"{words}: {one['before']}, {one['status'].replace('_', ' ')}")


def _only(names: list[str]) -> str:
    match names:
        case []:
            raise CliError(ExitCode.FAILED, "The daemon has no machine; its configuration needs a [[machine]].")
        case [name]:
            return name
        case _:
            raise CliError(
                ExitCode.USAGE, f"There are several machines: say --machine {' or '.join(map(safe, names))}."
            )


def _chunks(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while chunk := file.read(CHUNK_BYTES):
            yield chunk


def _answer(response: httpx.Response, url: str) -> Any:
    try:
        body = response.json() if response.content else None
    except ValueError as error:
        raise unreachable(url, "what answers there is not millstream") from error
    if response.is_success:
        return body
    if not isinstance(body, dict) or "code" not in body:
        raise unreachable(url, f"what answers there is not millstream (status {response.status_code})")
    raise CliError(ExitCode.FAILED, _explained(body), body)


def _explained(problem: Mapping[str, Any]) -> str:
    """A problem in words: title, detail, and the findings of a check where it has some."""
    lines = [f"{safe(problem.get('title', problem['code']))}: {safe(problem.get('detail', ''))}"]
    report = problem.get("report")
    if isinstance(report, Mapping):
        findings = [*report.get("errors", ()), *report.get("warnings", ())]
        lines += [f"  line {one['line']}: {safe(one['message'])}" for one in findings[:SHOWN_FINDINGS]]
        if len(findings) > SHOWN_FINDINGS:
            lines.append(f"  and {len(findings) - SHOWN_FINDINGS} more")
    lines += [f"  {told_setting(one)}" for one in problem.get("results", ()) if "number" in one]
    if problem["code"] in HINTS:
        lines.append(HINTS[problem["code"]])
    return "\n".join(lines)
