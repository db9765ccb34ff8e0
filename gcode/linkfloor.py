"""No faster than the link: what a program takes where its lines come more slowly than they are carried out.

The controller's queue decouples the two. Line j can be sent once line j - W has been carried out (W lines fit into the
queue) and the line before it has gone; its motion begins when it is there and the motion before it is over:

    arrived[j] = max(arrived[j-1], over[j-W]) + floor[j]        over[j] = max(over[j-1], arrived[j]) + seconds[j]

So slow motion lets the link run ahead by one queue, and no further. Not that a starving planner also brakes: the result
is still no more than a floor. The one rule: pieces of any size give the same.
"""

import numpy as np

from gcode.segments import Floats


class LinkFloor:
    """Turns seconds of motion into seconds with waiting; `window`: lines that the controller takes ahead, from 1."""

    def __init__(self, window: int) -> None:
        self._window = max(window, 1)
        # All times count from the end of the last motion: over[-W..-1], of which the last is 0, and arrived[-1].
        self._over = np.zeros(self._window)
        self._arrived = 0.0

    def slowed(self, seconds: Floats, floor_s: Floats) -> Floats:
        """Seconds of each row with the wait for its line before it. `floor_s`: what its line takes on the link."""
        if not len(seconds):
            return seconds
        window = self._window
        before = np.concatenate((self._over, np.cumsum(seconds)))
        arrived = self._arrivals(before[: len(seconds)], floor_s, self._arrived)
        if (arrived <= before[window - 1 : -1]).all():
            # Nothing ever waits: the motion is over when it would be without any link.
            self._keep(before, float(arrived[-1]))
            return seconds
        return self._step_by_step(seconds, floor_s)

    def _step_by_step(self, seconds: Floats, floor_s: Floats) -> Floats:
        """As many rows at once as the queue holds: what each waits for is over by then."""
        window = self._window
        over = np.concatenate((self._over, np.empty(len(seconds))))
        last = self._arrived
        for begin in range(0, len(seconds), window):
            end = min(begin + window, len(seconds))
            arrived = self._arrivals(over[begin:end], floor_s[begin:end], last)
            over[window + begin : window + end] = self._arrivals(
                arrived, seconds[begin:end], float(over[window + begin - 1])
            )
            last = float(arrived[-1])
        self._keep(over, last)
        slowed: Floats = np.diff(over[window - 1 :])
        return slowed

    @staticmethod
    def _arrivals(ready: Floats, takes: Floats, last: float) -> Floats:
        """done[j] = max(done[j-1], ready[j]) + takes[j], with done[-1] = `last`."""
        upto = np.cumsum(takes)
        begins = np.maximum.accumulate(np.maximum(ready - (upto - takes), last))
        done: Floats = begins + upto
        return done

    def _keep(self, over: Floats, arrived: float) -> None:
        end = over[-1]
        self._over = over[-self._window :] - end
        self._arrived = arrived - float(end)
