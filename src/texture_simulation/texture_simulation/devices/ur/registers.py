"""The registers through which a program on the controller and the world outside talk."""

from __future__ import annotations

COUNT = 48


class Registers:
    """Input and output registers of integers and doubles; `last_command_s` is when input_int_register_0 last came."""

    def __init__(self) -> None:
        self.int_in = [0] * COUNT
        self.double_in = [0.0] * COUNT
        self.int_out = [0] * COUNT
        self.double_out = [0.0] * COUNT
        self.last_command_s = 0.0
