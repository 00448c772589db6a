"""The registers through which a program on the controller and the world outside talk."""

from __future__ import annotations

import numpy as np

COUNT = 48


class Registers:
    """Input and output registers of integers and doubles.

    `last_command_s` is when the command register last came, and `excused_s` how much of the silence since then the
    client is not charged with.
    """

    def __init__(self) -> None:
        self.int_in = np.zeros(COUNT, dtype=np.int64)
        self.double_in = np.zeros(COUNT)
        self.int_out = np.zeros(COUNT, dtype=np.int64)
        self.double_out = np.zeros(COUNT)
        self.last_command_s = 0.0
        self.excused_s = 0.0

    def heard(self, time_s: float) -> None:
        """Take note that the command register came."""
        self.last_command_s, self.excused_s = time_s, 0.0

    def from_first(self, first: int) -> Registers:
        """Return the registers from a first one on, counted from there: what is written to them is written here."""
        shifted = Registers()
        for name in ('int_in', 'double_in', 'int_out', 'double_out'):
            setattr(shifted, name, getattr(self, name)[first:])
        return shifted
