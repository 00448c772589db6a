"""Numbers of the BioTac's protocol and streams.

Sources: "BioTac C Library Manual for Cheetah" v1.1.0 (frame, slot time, adapter settings), "BioTac QuickStart Guide"
(meaning of the channels); kth-ros-pkg/biotac_driver @6fb8e33 `biotac_sensors/include/biotac_sensors/biotac.h`
(commands, error words, chip selects); for the BioTac SP CNCR-NTU/biotac_sp_ros @e9f69b9.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from texture_core.signal import NANOSECONDS

SLOT_RATE_HZ = 4400.0  # samplings of any channel; a slot is 227.27 µs
SLOT_NS = NANOSECONDS / SLOT_RATE_HZ
FULL_SCALE = 4095  # 12 bits

# A sampling command is bit 7, the channel's index in bits 6..1, and a bit that makes the number of ones odd.
SAMPLE = 0x80
FIRST_ELECTRODE = 17
INDICES: Mapping[str, int] = {
    'pac': 0,
    'pdc': 1,
    'tac': 2,
    'tdc': 3,
    **{f'electrode{number}': FIRST_ELECTRODE + number - 1 for number in range(1, 25)},
}
# What a BioTac answers instead of a value when it does not like a command. The first byte has even parity.
ERROR_WORDS: Mapping[int, str] = {
    0xA545: 'bad parity of the command',
    0xA53F: 'unknown command',
    0xA52E: 'commands too close together',
    0xA52D: 'sampling commands too close together',
    0xA558: 'unknown channel',
    0xA55F: 'nothing to send again',
    0xA552: 'parameter is read-only',
    0xA557: 'writing failed',
}
ECHO_BYTES = 2  # came back while the command went out
WORD_BYTES = 2  # of each BioTac, after the echo

PAC = 'pac'
PAC_SENSOR, SLOW_SENSOR = 'biotac/pac', 'biotac/slow'
UNIT = 'count'


def sampling_command(channel: str) -> int:
    """Return the byte that samples a channel, such as 0x80 for 'pac' and 0xA2 for 'electrode1'."""
    byte = SAMPLE | INDICES[channel] << 1
    return byte | (byte.bit_count() + 1) % 2


@dataclass(frozen=True)
class BioTacLayout:
    """In which order the channels of one kind of BioTac are sampled: every second slot is PAC."""

    electrodes: int

    @cached_property
    def slots(self) -> tuple[str, ...]:
        """The channel sampled in each slot of a frame."""
        slow = (*(f'electrode{number}' for number in range(1, self.electrodes + 1)), 'pdc', 'tac', 'tdc')
        return tuple(channel for name in slow for channel in (name, PAC))

    @cached_property
    def slow_channels(self) -> tuple[str, ...]:
        """The channels sampled once a frame, in the order they are published."""
        return ('tdc', 'tac', 'pdc', *(f'electrode{number}' for number in range(1, self.electrodes + 1)))

    @cached_property
    def slow_slots(self) -> tuple[int, ...]:
        """The slot of each slow channel."""
        return tuple(self.slots.index(channel) for channel in self.slow_channels)

    @property
    def pac_per_frame(self) -> int:
        """How often a frame samples PAC; sample k in slot 2k + 1."""
        return len(self.slots) // 2

    @property
    def frame_s(self) -> float:
        """Length of a frame."""
        return len(self.slots) / SLOT_RATE_HZ

    @property
    def frame_rate_hz(self) -> float:
        """Frames per second, the rate of every slow channel."""
        return SLOT_RATE_HZ / len(self.slots)

    @property
    def pac_rate_hz(self) -> float:
        """Rate of PAC."""
        return SLOT_RATE_HZ / 2

    def slot_time_ns(self, slot: int) -> int:
        """Return the time of a slot after the start of its frame."""
        return round(slot * SLOT_NS)

    def frame_bytes(self, fingers: int) -> int:
        """Return the length of the reply to one frame from a board with so many BioTacs."""
        return len(self.slots) * (ECHO_BYTES + WORD_BYTES * fingers)


LAYOUTS: Mapping[str, BioTacLayout] = {
    'biotac': BioTacLayout(electrodes=19),  # 44 slots, 100 frames/s
    'biotac_sp': BioTacLayout(electrodes=24),  # 54 slots, 81.5 frames/s
}
FINGERS = 5  # most that one board holds
