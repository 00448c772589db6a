"""How long samples of a device were on the way, against its own clock."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass
class DelayModel:
    """Delay of the stream's clock against the host's: offset + drift · elapsed, and a residual that is slewed to 0."""

    start_ns: float = 0.0
    offset_ns: float = 0.0
    drift: float = 0.0
    residual_ns: float = 0.0  # at since_ns

    def trend_ns(self, elapsed_ns: float) -> float:
        """Return the linear part of the delay, without the residual."""
        return self.offset_ns + self.drift * elapsed_ns

    def delay_ns_at(self, elapsed_ns: float, slew_rate: float) -> float:
        """Return the delay with the remaining residual, which shrinks by `slew_rate` per time."""
        remaining = max(0.0, abs(self.residual_ns) - slew_rate * max(0.0, elapsed_ns - self.start_ns))
        return self.trend_ns(elapsed_ns) + math.copysign(remaining, self.residual_ns)
