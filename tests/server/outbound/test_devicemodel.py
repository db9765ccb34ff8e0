"""The model for agents: every item that is sent and no other, ids that are unique, units as the adapter counts."""

from collections import Counter
from xml.etree import ElementTree as ET

from server.config.model import MachineConfig
from server.outbound.devicemodel import NAMESPACE, axes_of, described, devices_xml
from server.outbound.shdr import Condition, Device

NS = {"m": NAMESPACE}
MACHINES = [
    MachineConfig(name="router", port="sim:"),
    MachineConfig.model_validate(
        {"name": "5-axis", "port": "sim:", "motion": {"travel": {"c": [0.0, 360.0], "a": [-90.0, 90.0]}}}
    ),
    MachineConfig(name="lathe", port="sim:", protocol="ncframe"),
]


def model() -> ET.Element:
    return ET.fromstring(devices_xml(described(MACHINES, "shop"), at="2026-03-01T09:00:00.000Z"))


def test_axes_are_those_of_the_protocol_and_of_the_configuration() -> None:
    assert [axes_of(machine) for machine in MACHINES] == ["xyz", "xyzac", "xz"]


def test_every_item_that_is_sent_and_no_other() -> None:
    devices = model().findall("m:Devices/m:Device", NS)
    assert [device.get("name") for device in devices] == ["router", "5-axis", "lathe"]
    for device, machine in zip(devices, MACHINES, strict=True):
        sent = Device(axes=axes_of(machine)).items(emergency=False)
        found = {item.get("name"): item.get("category") for item in device.iter(f"{{{NAMESPACE}}}DataItem")}
        assert found.keys() == sent.keys()
        conditions = {name for name, category in found.items() if category == "CONDITION"}
        assert conditions == {name for name, value in sent.items() if isinstance(value, Condition)}


def test_ids_are_unique_and_begin_with_a_letter() -> None:
    ids = [element.get("id") for element in model().iter() if element.get("id")]
    assert max(Counter(ids).values()) == 1
    assert all(one is not None and one[0].isalpha() for one in ids)


def test_units_are_those_of_the_standard() -> None:
    items = {item.get("id"): item for item in model().iter(f"{{{NAMESPACE}}}DataItem")}
    units = {
        name: (items[name].get("nativeUnits"), items[name].get("units")) for name in ("router_Fact", "m_5-axis_Aact")
    }
    assert units == {"router_Fact": ("MILLIMETER/MINUTE", "MILLIMETER/SECOND"), "m_5-axis_Aact": ("DEGREE", "DEGREE")}
    assert items["router_Xwork"].get("coordinateSystem") == "WORK"
    assert items["router_Sspeed"].get("type") == "ROTARY_VELOCITY"
