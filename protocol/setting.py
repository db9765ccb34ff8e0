"""What a controller says of one of its settings: its name, unit, type and limits. The same for every dialect.

No event (events.py) and no setting: its value stands in `SettingsRead`. The one rule: what a controller does not say
of a setting is None or empty, never a guess.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SettingDescription:
    """What a controller says of one of its settings. `datatype` and `form` as grblHAL has them; None: no limit."""

    number: int
    name: str
    unit: str
    datatype: int | None
    form: str
    minimum: float | None
    maximum: float | None
    reboot: bool
