"""What the machine says: the messages of standard §5, each behind its check header, waiting to go out.

It decides nothing. The one rule: whatever is put in here first goes out first.
"""

from collections.abc import Iterable

from sim.elvinto.codec import message, with_header
from sim.elvinto.settings import SimSettings
from sim.motion import AXES, Point


def number(value: float) -> str:
    """Ten-thousandths at most, and never `-0`."""
    return f"{value:.4f}".rstrip("0").rstrip(".") if round(value, 4) else "0"


class Voice:
    """Messages are built here and taken with `take`."""

    def __init__(self, settings: SimSettings) -> None:
        self._settings = settings
        self._waiting: list[bytes] = []

    def take(self) -> bytes:
        data = b"".join(self._waiting)
        self._waiting.clear()
        return data

    def clear(self) -> None:
        self._waiting.clear()

    def say(self, name: str, *params: tuple[str, str]) -> None:
        self._put(message(name, *params, encoding=self._settings.encoding))

    def received(self, wire_id: int) -> None:
        self.say("RECEIVED", ("ID", str(wire_id)))

    def ended(self, wire_id: int, error: int | None) -> None:
        if error is None:
            self.say("OK", ("ID", str(wire_id)))
        else:
            self.say("ERROR", ("ID", str(wire_id)), ("NUM", str(error)))

    def state(
        self,
        kind: str,
        shown: Point,
        *,
        feed: float,
        speed: float,
        alarm: tuple[int, int | None] | None,
        absolute: bool,
    ) -> None:
        """STATE. An alarm of the whole machine names axis 0."""
        fields = [("TYPE", kind)]
        fields += [(f"M{axis}", number(value)) for axis, value in zip(AXES, shown, strict=True)]
        fields += [("FEED", number(feed)), ("SPEED", number(speed))]
        if alarm is not None:
            fields += [("ALARMNUM", str(alarm[0])), ("AXISNUM", str(alarm[1] or 0))]
        fields.append(("ISABS", "Y" if absolute else "N"))
        data = message("STATE", *fields)
        if self._settings.literal_state:
            data = data.replace(b",", b", ").replace(b", ALARMNUM", b" ALARMNUM")
        self._put(data)

    def switches(self, closed: Iterable[str]) -> None:
        """Answer to W96, whose form the standard leaves open: the axes that stand on their start switch."""
        self.say("SWITCHES", ("START", "".join(closed)), ("END", ""))

    def about(self) -> None:
        """Answer to W97, whose form the standard leaves open."""
        self.say("MACHINE", ("NAME", "virtual mill"), ("STANDARD", "11"), ("AXES", AXES))

    def card(self) -> None:
        """Answer to READDIR."""
        files = self._settings.sd_files
        if files is None:
            self.say("SDD_NO")
            return
        readable = self._settings.sd_fs == "FAT"
        self.say("SDD_OK", ("TYPE", "SDHC"), ("FS", self._settings.sd_fs), ("ROOT", "OK" if readable else "NO"))
        if readable:
            self.say("DIR_BEGIN")
            for name in files:
                self.say("FILE", ("NAME", name))
            self.say(self._settings.dir_end)

    def _put(self, data: bytes) -> None:
        self._waiting.append(with_header(data, name=self._settings.header_name, radix=self._settings.crc_radix))
