"""A text as one frame of a WebSocket, as a server sends it (RFC 6455 §5.2): whole, not masked, not compressed.

Not a connection. The one rule: a message for a hundred readers is framed once, so no extension may change frames from
one reader to the next (serve.py switches permessage-deflate off).
"""

from websockets.frames import Frame, Opcode


def text_frame(text: str) -> bytes:
    """The bytes of the frame."""
    return Frame(Opcode.TEXT, text.encode()).serialize(mask=False)
