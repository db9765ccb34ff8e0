"""Is the daemon of this container alive: 0 or 1, for Docker's HEALTHCHECK. Run it as `python -m server.healthcheck`.

Not the doctor. The one rule: the standard library alone, for it runs every few seconds beside the stream, on small
computers too; so the address is looked up in the raw configuration, which the daemon has checked.
"""

import json
import os
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.request import ProxyHandler, build_opener

TIMEOUT_S = 4.0
"""Less than Docker's own: the reason is told."""
EVERYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104 - compared, not bound


def address(environ: Mapping[str, str], folder: Path) -> str:
    """Where the daemon answers. Raises OSError, ValueError for a configuration that cannot be read."""
    path = Path(environ.get("MILLSTREAM_CONFIG") or folder / "millstream.toml")
    server: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8")).get("server", {}) if path.exists() else {}
    host = environ.get("MILLSTREAM_SERVER__HOST") or str(server.get("host", "127.0.0.1"))
    port = environ.get("MILLSTREAM_SERVER__PORT") or server.get("port", 8420)
    return reach(host, port)


def reach(host: str, port: int | str) -> str:
    """Where a daemon answers on its own computer that was told to listen on `host`."""
    host = EVERYWHERE.get(host.strip("[]"), host.strip("[]"))
    return f"http://[{host}]:{port}/healthz" if ":" in host else f"http://{host}:{port}/healthz"


def answer(url: str) -> dict[str, Any]:
    """What the daemon says of itself. Raises OSError, ValueError."""
    # No proxy of the environment stands between a computer and itself.
    with build_opener(ProxyHandler({})).open(url, timeout=TIMEOUT_S) as response:
        said = json.load(response)
    if not isinstance(said, dict):
        raise ValueError("what answers there is not millstream")
    return said


def alive(url: str) -> str | None:
    """None when the daemon answers that it is; else what is wrong."""
    try:
        status = answer(url).get("status")
    except (OSError, ValueError) as error:
        return f"{url}: {error}"
    return None if status == "ok" else f"{url}: status {status!r}"


def main() -> int:
    """The exit code."""
    try:
        wrong = alive(address(os.environ, Path.cwd()))
    except (OSError, ValueError) as error:
        wrong = str(error)
    if wrong is not None:
        sys.stderr.write(wrong + "\n")
    return 0 if wrong is None else 1


if __name__ == "__main__":
    sys.exit(main())
