"""Jobs above the machines: the queue, the start, and going on after an interruption."""
