"""The row of the audit for a command that came through the broker. Not the command (mqtt.py), not the table (audit.py).

The one rule: it says no more than is known. Who has published the broker alone knows, so the row names the broker.
"""

from server.access.audit import Entry, clean
from server.config.telemetry import MqttConfig
from server.problems import ProblemError

METHOD = "MQTT"
ACCEPTED = 202
"""As the routes of the same verbs answer."""


def asked_by_broker(config: MqttConfig, machine: str, word: str, refused: ProblemError | None) -> Entry:
    """`word` was asked of a machine, and done, or refused because of `refused`."""
    return Entry(
        at="",
        via="mqtt",
        token=None,
        name="MQTT",
        address=clean(f"{config.host}:{config.port}"),
        method=METHOD,
        route=word,
        machine=machine,
        status=ACCEPTED if refused is None else refused.status,
        code=None if refused is None else refused.code,
    )
