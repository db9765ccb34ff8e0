"""Errors of the protocol core: ours are raised, a peer's are events.

`LocalError` is our own misuse of an engine and always a bug. What a machine does wrong never raises:
it is counted and reported as `protocol.events.ProtocolFault`.
"""


class MillstreamError(Exception):
    """Root of every error that the project raises on purpose."""


class LocalError(MillstreamError):
    """The caller broke an engine's contract (submitted while not free, skipped an ID, ...)."""


class MessageTooLongError(LocalError):
    """A command does not fit the machine's receive buffer; nothing was sent."""
