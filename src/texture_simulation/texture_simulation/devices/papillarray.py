"""The hub of one or two PapillArrays on a pseudo-terminal: listens to commands, streams what it is given."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from texture_core.arrays import Array
from texture_simulation.devices.device import EmulatedDevice
from texture_simulation.devices.faults import FrameFaults
from texture_simulation.devices.papillarray_encoder import PILLARS, QUANTITIES, PapillArrayEncoder

SAMPLING_HZ = 1000.0  # of the pillars; a lower rate sends each second, fourth or tenth
COMMAND = re.compile(rb'f(100|250|500|1000)\n|(z)\n')
KEPT_BYTES = 5  # of an incomplete command
USUAL_RATE_HZ = 100
UNKNOWN_TYPE = 8  # of a block that no driver knows


class EmulatedPapillArray(EmulatedDevice):
    """An emulated hub: `sample` it 1000 times a second.

    Parameters
    ----------
    link, rng
        See `EmulatedDevice`.
    arrays
        How many it carries.
    """

    def __init__(self, link: Path, rng: np.random.Generator, arrays: int = 1) -> None:
        super().__init__(link, rng)
        self.rate_hz = USUAL_RATE_HZ
        self.biases = 0  # how often the bias was set
        self._encoder = PapillArrayEncoder(arrays)
        self._unknown_encoder = PapillArrayEncoder(arrays, UNKNOWN_TYPE)
        self._received = b''
        self._bias: Array = np.zeros((arrays, PILLARS, QUANTITIES))
        self._newest: Array = self._bias
        self._clock_ms = self._sent = 0

    def reset(self) -> None:
        """Begin clock, numbers and bias again, as after a brown-out."""
        super().reset()
        self.rate_hz = USUAL_RATE_HZ
        self._bias = np.zeros_like(self._bias)
        self._clock_ms = self._sent = 0

    def sample(self, pillars: Array) -> None:
        """Let as many milliseconds pass as there are samples, and send those that the rate asks for.

        Parameters
        ----------
        pillars : (n, n_arrays, 9, 6)
            Forces (N) and displacements (mm) of each pillar.
        """
        self._execute(self._port.read())
        self._newest = pillars[-1]
        times_ms = self._clock_ms + np.arange(len(pillars))
        due = times_ms % round(SAMPLING_HZ / self.rate_hz) == 0
        if self.streaming and due.any():
            self._send(self._packets(1000.0 * times_ms[due], pillars[due] - self._bias))
        self._sent += int(due.sum())
        self.skip(len(pillars))

    def skip(self, milliseconds: int) -> None:
        """Let time pass of which nothing is sent."""
        self._clock_ms += milliseconds

    def _packets(self, times_us: Array, pillars: Array) -> bytes:
        encoder = self._unknown_encoder if self.wrong_firmware else self._encoder
        packets = encoder.packets(self._sent, times_us, pillars)
        if self.frame_faults == FrameFaults():
            return b''.join(packets)
        return b''.join(self.frame_faults.apply(packet, self._rng) for packet in packets)

    def _execute(self, data: bytes) -> None:
        received = self._received + data
        end = 0
        for command in COMMAND.finditer(received):
            end = command.end()
            if command.group(2):
                self.biases += 1
                self._bias = self._newest.copy()
            else:
                self.rate_hz = int(command.group(1))
        self._received = received[end:][-KEPT_BYTES:]
