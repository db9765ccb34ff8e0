"""NC frames: a program worked out on the host, down to the few numbers that a frame carries (ncframe §1-3).

Blocks in, frames out: increments in counts, no modes, no text. Not the bytes and not the link; those are of the wire.
The one rule: every word of a program is in a frame, has changed what the following frames are, or is an error that
names its line; nothing is dropped in silence.
"""
