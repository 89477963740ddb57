"""The rig file: which devices hang on which ports, and what their readings mean."""

import os
import tomllib
from dataclasses import dataclass
from pathlib import Path

from rig.devices import create_device
from rig.devices.base import Device
from rig.exceptions import RigError

Matrix = tuple[tuple[float, float, float], ...]
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
CONVENTIONS = {"on_body": 1.0, "on_sensor": -1.0}
DEFAULT_TOPIC = {"wrench": "/wrench", "imu": "/imu"}
KEYS = {
    "name": str,
    "kind": str,
    "port": str,
    "baudrate": int,
    "topic": str,
    "frame_id": str,
    "wrench": str,
    "rotation_to_body": list,
    "delay_to": str,
    "options": dict,
}


@dataclass(frozen=True)
class Entry:
    """One device of the rig.

    Attributes:
        name: unique, of letters, digits and underscores.
        port: a serial port, ``udp:NUMBER`` or ``emulator:RUN.mcap``.
        matrix: what turns three raw components into those in the body frame: the rotation to the body frame, and for a
            load cell that reads the wrench on itself the sign.
        delay_to: name of the IMU device whose angular velocity follows this device's columns omega_x, omega_y, omega_z.
    """

    name: str
    kind: str
    port: str
    device: Device
    baudrate: int
    topic: str
    frame_id: str
    matrix: Matrix
    settings: dict[str, str]
    delay_to: str = ""

    @property
    def required(self) -> bool:
        """Whether a recording needs its samples from start to end; a platform's command may come and go."""
        return self.device.measures != "values" or self.device.rate > 0


@dataclass(frozen=True)
class Rig:
    """A rig file: its path and its devices."""

    path: Path
    entries: tuple[Entry, ...]


def load_rig(path: str | os.PathLike[str]) -> Rig:
    """Read and check a rig file.

    Raises:
        RigError: it is no TOML, a key is missing, unknown or of a wrong type, or a value is wrong.
        OSError: it cannot be opened.
    """
    try:
        tables = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RigError(f"not a TOML file {path} ({error}): see docs/rig.md for the format") from error
    unknown = sorted(set(tables) - {"device"})
    devices = tables.get("device")
    if unknown or not isinstance(devices, list) or not devices:
        what = f"unknown key '{unknown[0]}' in" if unknown else "no [[device]] in"
        raise RigError(f"{what} rig file {path}: describe each sensor in a table [[device]]")
    entries = tuple(_entry(table, f"[[device]] number {i} of {path}") for i, table in enumerate(devices, 1))
    _check_unique(entries, path)
    return Rig(Path(path), entries)


def _entry(table: object, where: str) -> Entry:
    table = table if isinstance(table, dict) else {}
    for key, value in table.items():
        if key not in KEYS:
            raise RigError(f"unknown key '{key}' in {where}: it takes {', '.join(KEYS)}")
        if type(value) is not KEYS[key]:
            raise RigError(f"key '{key}' in {where} is {value!r}: give a {KEYS[key].__name__}")
    for key in ("name", "kind", "port"):
        if not table.get(key):
            raise RigError(f"no key '{key}' in {where}: every device needs name, kind and port")
    if not str(table["name"]).isidentifier():
        raise RigError(f"name '{table['name']}' in {where}: use letters, digits and underscores")
    return _checked(table, where)


def _checked(table: dict, where: str) -> Entry:
    options = dict(table.get("options", {}))
    port = _port(table["port"], where)
    if port.startswith("udp:") and table["kind"] == "line":
        options["whole_lines"] = True
    try:
        device = create_device(table["kind"], **options)
    except RigError as error:
        raise RigError(f"{error} (in {where})") from error
    sign = _sign(table, device, where)
    rotation = _rotation(table.get("rotation_to_body"), where)
    return Entry(
        name=table["name"],
        kind=table["kind"],
        port=port,
        device=device,
        baudrate=table.get("baudrate", device.BAUDRATE),
        topic=table.get("topic", DEFAULT_TOPIC.get(device.measures, f"/{table['name']}")),
        frame_id=table.get("frame_id", "body"),
        matrix=tuple((sign * a, sign * b, sign * c) for a, b, c in rotation),
        settings={key: str(value) for key, value in table.items() if key not in ("name", "port")},
        delay_to=table.get("delay_to", ""),
    )


def _port(text: str, where: str) -> str:
    if text.startswith("udp:") and not (text[4:].isdigit() and 0 < int(text[4:]) < 65536):
        raise RigError(f"port '{text}' in {where}: write udp:NUMBER, for example udp:5005")
    return text


def _sign(table: dict, device: Device, where: str) -> float:
    convention = table.get("wrench")
    if device.measures != "wrench":
        if convention is not None:
            raise RigError(f"key 'wrench' in {where} is for load cells: remove it")
        return 1.0
    if convention not in CONVENTIONS:
        raise RigError(
            f"key 'wrench' in {where} is {convention!r}: say whether the reading is the wrench 'on_body' or 'on_sensor'"
        )
    return CONVENTIONS[convention]


def _rotation(rows: list | None, where: str) -> Matrix:
    if rows is None:
        return IDENTITY
    numbers = [v for row in rows if isinstance(row, list) for v in row if type(v) in (int, float)]
    if len(rows) != 3 or len(numbers) != 9:
        raise RigError(f"key 'rotation_to_body' in {where}: give three rows of three numbers")
    matrix = tuple((float(a), float(b), float(c)) for a, b, c in rows)
    products = [sum(x * y for x, y in zip(p, q, strict=True)) for p in matrix for q in matrix]
    (a, b, c), (d, e, f), (g, h, i) = matrix
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    if any(abs(v - (k % 4 == 0)) > 1e-3 for k, v in enumerate(products)) or determinant < 0:
        raise RigError(f"key 'rotation_to_body' in {where} is no rotation: its rows must be orthonormal, right-handed")
    return matrix


def _check_unique(entries: tuple[Entry, ...], path: str | os.PathLike[str]) -> None:
    for attribute in ("name", "topic"):
        values = [getattr(entry, attribute) for entry in entries]
        for value in values:
            if values.count(value) > 1:
                raise RigError(f"{attribute} '{value}' twice in {path}: give each device its own")
    names = {entry.name for entry in entries if entry.device.measures == "imu"}
    for entry in entries:
        if entry.delay_to and entry.delay_to not in names:
            raise RigError(f"delay_to '{entry.delay_to}' in {path} names no IMU: choose one of {', '.join(names)}")
