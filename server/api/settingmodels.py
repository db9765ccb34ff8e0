"""The shapes of requests and answers about the settings of a controller and their backups.

Not their meaning (server/machine/storedsettings.py). The one rule is that of models.py: a request with a field that is
not here is refused; a value is a word, a number, true or false, and nothing else.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, StrictBool, StrictFloat, StrictInt, StrictStr

from server.api.models import TIME, example, request_example

MAX_SETTINGS = 1000
MAX_VALUE_CHARS = 80


class BitView(BaseModel):
    """A bit of a setting that is a mask; `on` is null where the value is no number."""

    model_config = example(bit=0, name="X", on=True)
    bit: int
    name: str
    on: bool | None


SETTING_EXAMPLE: dict[str, Any] = {
    "number": 110,
    "value": "500.000",
    "name": "X-axis maximum rate",
    "unit": "mm/min",
    "min": 0,
    "max": None,
    "meaning": "speed of rapids; feeds are limited to it",
    "kind": "number",
    "bits": [],
    "choices": [],
}


class SettingView(BaseModel):
    """A setting. `value` as the controller prints it; `min` and `max` are in `unit`, null: no limit; `choices`: what 0,
    1, ... stand for. A setting of which nothing is known has its number and value, and null for the rest."""

    model_config = example(**SETTING_EXAMPLE)
    number: int
    value: str
    name: str | None
    unit: str | None
    min: float | None
    max: float | None
    meaning: str | None
    kind: Literal["bool", "mask", "integer", "number", "text"] | None
    bits: list[BitView]
    choices: list[str]


class SettingsView(BaseModel):
    """All settings of the controller, by number."""

    model_config = example(machine="router", settings=[SETTING_EXAMPLE])
    machine: str
    settings: list[SettingView]


SettingNumber = Annotated[str, Field(pattern=r"^[0-9]{1,4}$")]
SettingValue = Annotated[StrictStr, Field(max_length=MAX_VALUE_CHARS)] | StrictBool | StrictInt | StrictFloat


class SettingsRequest(BaseModel):
    """New values by number, as text or number; true and false are 1 and 0."""

    model_config = request_example(values={"110": "600", "22": True})
    values: Annotated[dict[SettingNumber, SettingValue], Field(min_length=1, max_length=MAX_SETTINGS)]

    def texts(self) -> dict[int, str]:
        """As the controller is to be sent them."""
        return {int(number): _text(value) for number, value in self.values.items()}


def _text(value: str | bool | float) -> str:
    if isinstance(value, str):
        return value.strip()
    if isinstance(value, float):
        return f"{value:.6f}".rstrip("0").rstrip(".")
    return str(int(value))


class SettingResult(BaseModel):
    """What became of one setting. `value` is read back; `unchanged`: it was so already; `not_written`: one before it
    failed."""

    model_config = example(
        number=110, name="X-axis maximum rate", asked="600", before="500.000", value="600.000", status="written"
    )
    number: int
    name: str | None
    asked: str
    before: str
    value: str
    status: Literal["written", "unchanged", "failed", "not_written"]


class DifferenceView(BaseModel):
    """A setting with two values; null: not there."""

    model_config = example(number=20, name="soft limits", unit="", before="1", value="0")
    number: int
    name: str | None
    unit: str | None
    before: str | None
    value: str | None


RESULT_EXAMPLE: dict[str, Any] = {
    "number": 110,
    "name": "X-axis maximum rate",
    "asked": "600",
    "before": "500.000",
    "value": "600.000",
    "status": "written",
}


class SettingsResult(BaseModel):
    """A result for each setting, in the order of writing. `backup` has everything as it was, null where nothing was
    written. `also_changed`: what the controller has changed with it of its own accord."""

    model_config = example(machine="router", backup=12, results=[RESULT_EXAMPLE], also_changed=[])
    machine: str
    backup: int | None
    results: list[SettingResult]
    also_changed: list[DifferenceView]


class RestoreResult(SettingsResult):
    """As of a change. `left_out`: numbers of the backup that the controller does not have."""

    model_config = example(machine="router", backup=13, results=[RESULT_EXAMPLE], also_changed=[], left_out=[])
    left_out: list[int]


BACKUP_EXAMPLE: dict[str, Any] = {
    "id": 12,
    "at": TIME,
    "why": "change",
    "made_by": "ann",
    "firmware": "grbl 1.1h 20190830",
    "settings": 34,
}


class BackupHead(BaseModel):
    """A backup: made before what, by whom, of how many settings of which firmware."""

    model_config = example(**BACKUP_EXAMPLE)
    id: int
    at: str
    why: Literal["change", "restore", "defaults"]
    made_by: str
    firmware: str
    settings: int


class BackupView(BackupHead):
    """A backup with its content. Offsets (mm), start-up blocks and info text are in those that were made before the
    defaults were restored. `differences`: the settings that are otherwise now (`before`: in the backup, `value`: now),
    null where the machine could not be asked (`not_compared` says why)."""

    model_config = example(
        **BACKUP_EXAMPLE,
        values={"110": "500.000"},
        offsets={},
        startup_blocks=[],
        info=None,
        differences=[
            {"number": 110, "name": "X-axis maximum rate", "unit": "mm/min", "before": "500.000", "value": "600.000"}
        ],
        not_compared=None,
    )
    values: dict[str, str]
    offsets: dict[str, dict[str, float]]
    startup_blocks: list[str]
    info: str | None
    differences: list[DifferenceView] | None
    not_compared: str | None
