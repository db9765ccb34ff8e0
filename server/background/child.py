"""The other side of `childworker.py`: a process that is handed functions and hands back what they return.

Started as `python -m server.background.child`, by the daemon alone. The one rule: it lives no longer than the daemon:
when its standard input ends, so does it, in the middle of whatever it computes.
"""

import os
import pickle
import signal
import struct
import sys
import threading
from queue import SimpleQueue
from typing import Any, BinaryIO

LENGTH = struct.Struct("<Q")
"""Before each pickle."""
POLITE = 10
"""Of the system's 19: the stream of the daemon comes first where there is one core."""


def write_block(to: BinaryIO, data: bytes) -> None:
    """One block, whole."""
    to.write(LENGTH.pack(len(data)))
    to.write(data)
    to.flush()


def read_block(of: BinaryIO) -> bytes | None:
    """The next block; None where there is no whole one any more."""
    head = of.read(LENGTH.size)
    if len(head) < LENGTH.size:
        return None
    (length,) = LENGTH.unpack(head)
    data = of.read(length)
    return data if len(data) == length else None


def answered(request: bytes) -> bytes:
    """What came of a request, for `opened`."""
    try:
        fn, args, kwargs = pickle.loads(request)  # noqa: S301 - from the daemon, over a pipe that nobody else has
        return pickle.dumps((True, fn(*args, **kwargs)))
    except Exception as error:  # noqa: BLE001 - it is raised again where it is waited for
        return _packed(error)


def _packed(error: Exception) -> bytes:
    """Without what makes it: an error may ask for more in its making than it keeps as `args`."""
    try:
        return pickle.dumps((False, (type(error), error.args, vars(error))))
    except Exception:  # noqa: BLE001 - whatever a pickle does not take
        return pickle.dumps((False, (RuntimeError, (f"{type(error).__name__}: {error}",), {})))


def opened(answer: bytes) -> Any:
    """The result. Raises the error that there was instead."""
    went_well, value = pickle.loads(answer)  # noqa: S301 - from our own process
    if went_well:
        return value
    kind, args, kept = value
    error = kind.__new__(kind, *args)
    error.args = args
    vars(error).update(kept)
    raise error


def _listen(of: BinaryIO, requests: "SimpleQueue[bytes]") -> None:
    while (request := read_block(of)) is not None:
        requests.put(request)
    os._exit(0)


def main() -> None:
    """Answer until standard input ends."""
    os.nice(POLITE)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the daemon's; it ends us
    to = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a function prints must not stand between the blocks
    requests: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(sys.stdin.buffer, requests), daemon=True).start()
    while True:
        write_block(to, answered(requests.get()))


if __name__ == "__main__":
    main()
