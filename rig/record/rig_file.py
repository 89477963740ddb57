"""The rig file: which devices hang on which ports, and what their readings mean."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal
from urllib.parse import urlsplit

import msgspec
import numpy as np

from rig.devices import create_device, device_class, kinds
from rig.devices.base import Device
from rig.exceptions import RigError, listed, quoted
from rig.read_limits import read_file
from rig.record.port import Address, on_network
from rig.toml_tables import LARGEST_FILE, TomlError, TomlTable, WrongKeyError, parse_toml, read_table

Matrix = tuple[tuple[float, float, float], ...]
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
OWN_TOPICS = ("/diagnostics", "/mark")
"""Topics that every recording has, beside /raw/NAME."""
DEFAULT_TOPIC = {"wrench": "/wrench", "imu": "/imu", "joints": "/joint_states"}
LONGEST_NAME, LONGEST_PORT = 40, 120
"""Characters of a device's name and of a port's, which messages repeat."""
Row = tuple[float, float, float]
Text = Annotated[str, msgspec.Meta(min_length=1)]


class DeviceTable(TomlTable, frozen=True, kw_only=True):
    """``[[device]]``: a sensor, or the platform's command."""

    name: Text
    """Name of the device: letters, digits and underscores; unique."""
    kind: Annotated[Text, msgspec.Meta(extra_json_schema={"enum": list(kinds())})]
    """The family of devices."""
    port: Text
    """A serial port, best by /dev/serial/by-id/...; udp://ADDRESS or tcp://ADDRESS; udp:NUMBER; emulator:RUN.mcap."""
    baudrate: Annotated[int, msgspec.Meta(ge=1, le=100_000_000)] | None = None
    """Baud rate of the serial port [1/s]; missing: the device's default."""
    topic: str | None = None
    """Topic of the device's messages; missing: /wrench, /imu, or the device's name."""
    frame_id: str = "body"
    """The frame that the messages name."""
    wrench: Literal["on_body", "on_sensor"] | None = None
    """Sign of a load cell's reading: the wrench on the body, or the wrench on the sensor."""
    wrench_frame: Literal["sensor", "base"] | None = None
    """Axes of a robot's wrench: those of its sensor (the tool), or those of its base."""
    compensated: Literal["none", "gravity"] | None = None
    """Compensation of a robot's wrench: whether the robot removes the weight of the payload that is set on it."""
    rotation_to_body: tuple[Row, Row, Row] = IDENTITY
    """Rotation matrix from components along the sensor's axes to components along the body's."""
    delay_to: str = ""
    """Name of the IMU that follows this device's columns omega_x, omega_y, omega_z."""
    options: Mapping[str, Any] = {}
    """Settings of the device's kind; see docs/how-to/rig.md."""

    def __post_init__(self) -> None:
        """Refuse a name, a port or a rotation that is none, or too long for a message or a table."""
        if not self.name.isidentifier():
            raise WrongKeyError("name", "use letters, digits and underscores")
        if len(self.name) > LONGEST_NAME:
            raise WrongKeyError("name", f"use at most {LONGEST_NAME} characters")
        self._check_port()
        rows = np.array(self.rotation_to_body)
        with np.errstate(all="ignore"):
            orthonormal = np.allclose(rows @ rows.T, np.eye(3), rtol=0, atol=1e-3)
        if not (orthonormal and np.linalg.det(rows) > 0):
            raise WrongKeyError("rotation_to_body", "its rows must be orthonormal, right-handed", "is no rotation")

    def _check_port(self) -> None:
        other = self.port.startswith(("emulator:", "udp:")) and not on_network(self.port)
        if len(self.port) > LONGEST_PORT and not other:
            raise WrongKeyError("port", f"write a path of at most {LONGEST_PORT} characters, if need be by a link")
        if on_network(self.port):
            try:
                Address.of(self.port, 1)
            except ValueError as error:
                raise WrongKeyError("port", "write udp://ADDRESS or tcp://ADDRESS:NUMBER") from error
            return
        number = self.port.removeprefix("udp:")
        numeric = number.isascii() and number.isdigit() and len(number) <= 5
        if number != self.port and not (numeric and 0 < int(number) < 65536):
            raise WrongKeyError("port", "write udp:NUMBER to listen, such as udp:5005, or udp://ADDRESS")


class RigFile(TomlTable, frozen=True, kw_only=True):
    """A rig file: a table for each device."""

    device: tuple[DeviceTable, ...] = ()
    """Load cells, IMUs and the platform's command."""

    def __post_init__(self) -> None:
        """Refuse a file without devices."""
        if not self.device:
            raise WrongKeyError("device", "describe each sensor in a table [[device]]", "holds nothing")


@dataclass(frozen=True)
class DeviceEntry:
    """One device of the rig.

    Attributes:
        name: unique, of letters, digits and underscores.
        port: a serial port, ``udp://ADDRESS``, ``tcp://ADDRESS``, ``udp:NUMBER`` or ``emulator:RUN.mcap``.
        topics: of each of the device's channels.
        matrix: what turns three raw components into those in the body frame: the rotation to the body frame, and for a
            load cell that reads the wrench on itself the sign.
        paced: whether its bytes come at the baud rate; a line that states none may be USB, which has none.
        delay_to: name of the IMU device whose angular velocity follows this device's columns omega_x, omega_y, omega_z.
    """

    name: str
    port: str
    device: Device
    baudrate: int
    topics: tuple[str, ...]
    frame_id: str
    matrix: Matrix
    settings: dict[str, str]
    paced: bool = True
    delay_to: str = ""

    @property
    def topic(self) -> str:
        """The topic of what the device is there for."""
        return self.topics[0]

    @property
    def wrong_device(self) -> str:
        """Advice for bytes that make no sense."""
        if self.device.NETWORK:
            return f"another device than '{self.device.kind}' is at this address, correct `port` or `kind`"
        return (
            f"wrong baud rate ({self.baudrate}) or another device than '{self.device.kind}', set `baudrate` or `kind`"
        )

    @property
    def required(self) -> bool:
        """Whether a recording needs its samples from start to end; a platform's command may come and go."""
        return self.device.measures != "values" or self.device.rate > 0


@dataclass(frozen=True)
class Rig:
    """A rig file: its path and its devices."""

    path: Path
    entries: tuple[DeviceEntry, ...]


def load_rig(path: str | os.PathLike[str]) -> Rig:
    """Read and check a rig file.

    Raises:
        RigError: it is no TOML, a key is missing, unknown or of a wrong type, or a value is wrong.
        OSError: it cannot be opened.
    """
    data = read_file(path, LARGEST_FILE)
    try:
        document = parse_toml(data)
    except TomlError as error:
        raise RigError(f"not a TOML file {path} ({error}): see docs/how-to/rig.md for the format") from error
    try:
        tables = read_table("", document, RigFile).device
        written = [{key: str(value) for key, value in table.items()} for table in document["device"]]
        entries = tuple(_entry(table, settings) for table, settings in zip(tables, written, strict=True))
    except (TomlError, RigError) as error:
        raise RigError(f"{error} (in {path})") from error
    _check_together(entries, path)
    return Rig(Path(path), entries)


def _entry(table: DeviceTable, settings: dict[str, str]) -> DeviceEntry:
    lines = {"whole_lines": True} if table.port.startswith("udp:") and table.kind == "line" else {}
    device = create_device(table.kind, **{**table.options, **lines, **_robot(table)})
    sign = _sign(table, device)
    _check_line(table, device)
    return DeviceEntry(
        name=table.name,
        port=table.port,
        device=device,
        baudrate=device.BAUDRATE if table.baudrate is None else table.baudrate,
        topics=_topics(table, device),
        frame_id=table.frame_id,
        matrix=tuple((sign * a, sign * b, sign * c) for a, b, c in table.rotation_to_body),
        paced=table.baudrate is not None or table.kind != "line",
        settings={key: text for key, text in settings.items() if key not in ("name", "port")},
        delay_to=table.delay_to,
    )


def _robot(table: DeviceTable) -> dict[str, object]:
    """Return the robot's treatment of its wrench, as the rig file says; refuse a guess."""
    where, kind = f"device[{table.name}]", device_class(table.kind)
    for option in kind.DECLARED:
        if option not in table.options:
            raise RigError(f"missing key {where}.options.{option}: state it, see docs/how-to/robot-wrench.md")
    if not kind.ROBOT:
        if table.wrench_frame or table.compensated:
            raise RigError(f"{where}.wrench_frame and compensated are for robots: remove them")
        return {}
    if table.wrench_frame is None:
        raise RigError(f"missing key {where}.wrench_frame: say whether its wrench is along 'sensor' or 'base' axes")
    if table.compensated is None:
        raise RigError(f"missing key {where}.compensated: say whether the robot removes weight, 'none' or 'gravity'")
    return {"wrench_frame": table.wrench_frame, "compensated": table.compensated}


def _topics(table: DeviceTable, device: Device) -> tuple[str, ...]:
    first, *others = (DEFAULT_TOPIC.get(channel.measures, f"/{table.name}") for channel in device.channels)
    return (first if table.topic is None else table.topic, *others)


def _check_line(table: DeviceTable, device: Device) -> None:
    """Refuse a port that a device cannot be on."""
    where, network, emulated = f"device[{table.name}]", device.NETWORK, table.port.startswith("emulator:")
    if network and not (emulated or table.port.startswith(f"{network}://")):
        raise RigError(f"{where}.port is no address, and '{table.kind}' is on the network: write {network}://ADDRESS")
    if network and table.baudrate is not None:
        raise RigError(f"{where}.baudrate is for serial lines, and '{table.kind}' is on the network: remove it")
    if network and device.rate < 1:
        raise RigError(
            f"{where}.options.rate: 1 Hz or more, since 2 s of silence mean that '{table.kind}' has restarted"
        )
    if not network and on_network(table.port) and (table.port.startswith("udp") or not urlsplit(table.port).port):
        raise RigError(f"{where}.port: '{table.kind}' is on a serial line; a serial server is tcp://ADDRESS:NUMBER")


def _sign(table: DeviceTable, device: Device) -> float:
    where = f"device[{table.name}].wrench"
    if device.measures == "wrench" and table.wrench is None:
        raise RigError(f"missing key {where}: say whether the reading is the wrench 'on_body' or 'on_sensor'")
    if device.measures != "wrench" and table.wrench is not None:
        raise RigError(f"{where} is for load cells: remove it")
    return -1.0 if table.wrench == "on_sensor" else 1.0


def _check_together(entries: tuple[DeviceEntry, ...], path: str | os.PathLike[str]) -> None:
    names = [entry.name for entry in entries]
    topics = [topic for entry in entries for topic in entry.topics]
    for attribute, values in (("name", names), ("topic", topics)):
        for value in values:
            if values.count(value) > 1:
                raise RigError(f"{attribute} {quoted(value)} twice in {path}: give each device its own")
    names = [entry.name for entry in entries if entry.device.measures == "imu"]
    for entry in entries:
        if any(topic in OWN_TOPICS or topic.startswith("/raw/") for topic in entry.topics):
            raise RigError(
                f"the topic of device[{entry.name}] in {path} is one that the recorder itself writes: "
                "choose another `topic`"
            )
        if entry.delay_to and entry.delay_to not in names:
            raise RigError(f"delay_to {quoted(entry.delay_to)} in {path} names no IMU: choose one of {listed(names)}")
