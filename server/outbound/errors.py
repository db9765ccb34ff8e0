"""What is wrong with a way out before the daemon has started. Later nothing of it raises.

The one rule: the message names the key of the configuration, and what to do.
"""


class OutboundError(Exception):
    """A way out cannot be opened."""
