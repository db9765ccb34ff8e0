"""The machines as an MTConnect agent wants them described: a Devices.xml with the data items that the adapter sends.

Not the values (shdr.py). The one rule: an item stands here if and only if the adapter sends it, under the same name;
an id is unique in the document, and units are those in which the adapter counts (`nativeUnits`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as ET

from server.config.model import MachineConfig
from server.outbound.shdr import axis_items

NAMESPACE = "urn:mtconnect.org:MTConnectDevices:1.8"
SCHEMA = f"{NAMESPACE} http://schemas.mtconnect.org/schemas/MTConnectDevices_1.8.xsd"
LATHE_AXES, MILL_AXES = "xz", "xyz"
LINEAR = "xyzuvw"

Element = ET.Element


@dataclass(frozen=True, slots=True)
class Described:
    """A machine as the model has it."""

    name: str
    uuid: str
    axes: str


def axes_of(machine: MachineConfig) -> str:
    """The axes of a machine: those that its protocol has at least, and those whose travel or steps are configured."""
    least = LATHE_AXES if machine.protocol == "ncframe" else MILL_AXES
    said = {*machine.motion.travel.known(), *machine.motion.steps_per_mm.known()}
    return least + "".join(sorted(said - set(least)))


def described(machines: Sequence[MachineConfig], host: str) -> list[Described]:
    """`host` tells two daemons' machines of one name apart."""
    return [Described(one.name, f"millstream-{host}-{one.name}", axes_of(one)) for one in machines]


def devices_xml(devices: Sequence[Described], *, at: str) -> str:
    """The document; `at` is the time that it is made."""
    root = Element("MTConnectDevices", {"xmlns": NAMESPACE})
    root.set("xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance")
    root.set("xsi:schemaLocation", SCHEMA)
    head = {"creationTime": at, "sender": "millstream", "instanceId": "1", "version": "1.8", "bufferSize": "131072"}
    ET.SubElement(root, "Header", {**head, "assetBufferSize": "1024", "assetCount": "0"})
    place = ET.SubElement(root, "Devices")
    for device in devices:
        _Model(device).into(place)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


class _Model:
    """One device; an XML id begins with a letter."""

    def __init__(self, device: Described) -> None:
        self.device = device
        self.mark = device.name if device.name[0].isalpha() else f"m_{device.name}"

    def into(self, place: Element) -> None:
        name, uuid = self.device.name, self.device.uuid
        root = ET.SubElement(place, "Device", {"id": self.mark, "name": name, "uuid": uuid})
        ET.SubElement(root, "Description", {"manufacturer": "millstream"})
        self._items(root, ("avail", "EVENT", "AVAILABILITY", {}))
        inside = ET.SubElement(root, "Components")
        self._axes(inside)
        self._controller(inside)

    def _component(self, place: Element, kind: str, name: str) -> Element:
        return ET.SubElement(place, kind, {"id": f"{self.mark}_{name}_", "name": name})

    def _items(self, place: Element, *items: tuple[str, str, str, dict[str, str]]) -> None:
        inside = ET.SubElement(place, "DataItems")
        for name, category, kind, more in items:
            attributes = {"id": f"{self.mark}_{name}", "name": name, "category": category, "type": kind, **more}
            ET.SubElement(inside, "DataItem", attributes)

    def _axes(self, place: Element) -> None:
        axes = ET.SubElement(self._component(place, "Axes", "axes"), "Components")
        for axis in self.device.axes:
            linear = axis in LINEAR
            units = "MILLIMETER" if linear else "DEGREE"
            kind = ("Linear", "POSITION") if linear else ("Rotary", "ANGLE")
            more = {"subType": "ACTUAL", "units": units, "nativeUnits": units}
            machine, work = axis_items(axis)
            self._items(
                self._component(axes, kind[0], axis.upper()),
                (machine, "SAMPLE", kind[1], {**more, "coordinateSystem": "MACHINE"}),
                (work, "SAMPLE", kind[1], {**more, "coordinateSystem": "WORK"}),
            )
        speed = {"subType": "ACTUAL", "units": "REVOLUTION/MINUTE", "nativeUnits": "REVOLUTION/MINUTE"}
        percent = {"units": "PERCENT", "nativeUnits": "PERCENT"}
        self._items(
            self._component(axes, "Rotary", "S"),
            ("Sspeed", "SAMPLE", "ROTARY_VELOCITY", speed),
            ("Sovr", "EVENT", "ROTARY_VELOCITY_OVERRIDE", percent),
        )

    def _controller(self, place: Element) -> None:
        controller = self._component(place, "Controller", "controller")
        self._items(
            controller,
            ("estop", "EVENT", "EMERGENCY_STOP", {}),
            ("system", "CONDITION", "SYSTEM", {}),
            ("comms", "CONDITION", "COMMUNICATIONS", {}),
        )
        feed = {"subType": "ACTUAL", "units": "MILLIMETER/SECOND", "nativeUnits": "MILLIMETER/MINUTE"}
        percent = {"units": "PERCENT", "nativeUnits": "PERCENT"}
        self._items(
            self._component(ET.SubElement(controller, "Components"), "Path", "path"),
            ("mode", "EVENT", "CONTROLLER_MODE", {}),
            ("execution", "EVENT", "EXECUTION", {}),
            ("program", "EVENT", "PROGRAM", {}),
            ("line", "EVENT", "LINE_NUMBER", {"subType": "ABSOLUTE"}),
            ("tool", "EVENT", "TOOL_NUMBER", {}),
            ("Fact", "SAMPLE", "PATH_FEEDRATE", feed),
            ("Fovr", "EVENT", "PATH_FEEDRATE_OVERRIDE", {"subType": "PROGRAMMED", **percent}),
            ("Frapidovr", "EVENT", "PATH_FEEDRATE_OVERRIDE", {"subType": "RAPID", **percent}),
            ("motion", "CONDITION", "MOTION_PROGRAM", {}),
        )
