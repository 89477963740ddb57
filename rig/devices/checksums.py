"""Checksums of the devices' frames: CRC-16/X-25, CRC-16/MODBUS, Fletcher's sum. Plain sums stay with their devices."""

from binascii import crc_hqx
from itertools import accumulate

_REVERSED = bytes(int(f"{i:08b}"[::-1], 2) for i in range(256))
"""The 256 values of a byte with their bits in reverse order."""


def crc16_x25(data: bytes | bytearray) -> int:
    """CRC-16/X-25: polynomial 0x1021 reflected, start and final XOR 0xFFFF. ``123456789`` gives 0x906E."""
    plain = crc_hqx(data.translate(_REVERSED), 0xFFFF) ^ 0xFFFF
    return _REVERSED[plain & 0xFF] << 8 | _REVERSED[plain >> 8]


def _modbus_entry(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ (0xA001 if byte & 1 else 0)
    return byte


_MODBUS = tuple(_modbus_entry(byte) for byte in range(256))


def crc16_modbus(data: bytes | bytearray) -> int:
    """CRC-16/MODBUS: polynomial 0x8005 reflected, start 0xFFFF, sent low byte first. ``123456789`` gives 0x4B37."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _MODBUS[(crc ^ byte) & 0xFF]
    return crc


def fletcher(data: bytes | bytearray) -> bytes:
    """The two sums over all bytes before them: the bytes, and their running sums, each modulo 256."""
    return bytes([sum(data) & 0xFF, sum(accumulate(data)) & 0xFF])
