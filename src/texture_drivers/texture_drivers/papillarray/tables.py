"""Numbers of the PapillArray's protocol and streams.

Source: langxin11/contactile-papillarray-ros2, the description of the controller's protocol 2.0 (PTS, 2025). All numbers
are little endian; offsets count from the byte after the start mark.
"""

from __future__ import annotations

START = b'\x55\x66\x77\x88'
END = b'\xaa\xbb\xcc\xdd'
CHECKSUM_BYTES = 2  # the sum of all bytes between the start mark and itself, modulo 65536
MAX_PACKET_BYTES = 8192

# Types of blocks, as the index at the beginning of a packet names them.
HUB, PILLARS, WHOLE = 1, 3, 4  # the hub's counter and clock; each pillar; the whole array. 5 to 7 are slip
HUB_BYTES = 12  # counter u32, time u64 in µs
VALUES_TYPE = 2  # before the six values of a pillar, and of a whole array
TYPE_BYTES, COUNT_BYTES = 2, 2
VALUES_BYTES = 6 * 4

SENSORS = 2  # that a hub can carry
COMMANDS_OF_RATE = {100: b'f100\n', 250: b'f250\n', 500: b'f500\n', 1000: b'f1000\n'}
BIAS_COMMAND = b'z\n'  # takes 2 s, in which nothing may touch the pillars
BIAS_S = 2.0

SIGNAL, WRENCH = 'signal', 'wrench'
PILLARS_SENSOR, WHOLE_SENSOR = 'papillarray/pillars', 'papillarray/whole'
PILLAR_QUANTITIES = {'fx': 'N', 'fy': 'N', 'fz': 'N', 'dx': 'mm', 'dy': 'mm', 'dz': 'mm'}
WHOLE_QUANTITIES = {'fx': 'N', 'fy': 'N', 'fz': 'N', 'tx': 'N mm', 'ty': 'N mm', 'tz': 'N mm'}


def pillar_channels(pillars: int) -> tuple[str, ...]:
    """Return the names of the pillars' channels: 'p0_fx' to 'p0_dz', 'p1_fx' and so on."""
    return tuple(f'p{number}_{quantity}' for number in range(pillars) for quantity in PILLAR_QUANTITIES)
