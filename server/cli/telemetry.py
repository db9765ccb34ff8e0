"""`millstream mtconnect-devices`: what an MTConnect agent has to know of the machines, from the configuration.

Not the adapter (server/outbound/). The one rule: it asks no daemon and no machine; the file is the same until the
configuration changes.
"""

import socket

import typer

from server.cli.common import CliError, ConfigFile, ExitCode, say
from server.cli.settings import configuration
from server.clock import WallClock, stamp


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(name="mtconnect-devices")(mtconnect_devices)


def mtconnect_devices(ctx: typer.Context, config: ConfigFile = None) -> None:
    """Print the Devices.xml of an MTConnect agent for the machines of the configuration."""
    from server.outbound.devicemodel import described, devices_xml

    settings = configuration(ctx, config)
    if not settings.machine:
        raise CliError(ExitCode.USAGE, "No machine is configured.")
    say(devices_xml(described(settings.machine, socket.gethostname()), at=stamp(WallClock())).rstrip())
