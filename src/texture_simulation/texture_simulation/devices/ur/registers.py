"""The registers through which a program on the controller and the world outside talk."""

from __future__ import annotations

COUNT = 48


class Registers:
    """Input and output registers of integers and doubles.

    `last_command_s` is when input_int_register_0 last came, and `excused_s` how much of the silence since then the
    client is not charged with.
    """

    def __init__(self) -> None:
        self.int_in = [0] * COUNT
        self.double_in = [0.0] * COUNT
        self.int_out = [0] * COUNT
        self.double_out = [0.0] * COUNT
        self.last_command_s = 0.0
        self.excused_s = 0.0

    def heard(self, time_s: float) -> None:
        """Take note that input_int_register_0 came."""
        self.last_command_s, self.excused_s = time_s, 0.0
