"""Which faults are injected, when, and for how long."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Fault:
    """A kind of fault.

    Parameters
    ----------
    action
        What is done: 'unplug', 'corrupt', 'freeze' or 'kill'.
    node
        Whom it is injected.
    weight
        How often, compared with the others.
    low_s, high_s
        How long it may last; a killed node is away until the launcher has started it again.
    """

    action: str
    node: str
    weight: float
    low_s: float = 0.0
    high_s: float = 0.0


# Kills are rare, so that nodes also live long enough to show whether their memory grows.
FAULTS: Mapping[str, Fault] = {
    'sensor unplugged': Fault('unplug', 'emulator', 3.0, 0.3, 4.0),
    'bytes corrupted': Fault('corrupt', 'emulator', 3.0, 1.0, 5.0),
    'emulator frozen': Fault('freeze', 'emulator', 2.0, 0.2, 3.0),
    'explorer frozen': Fault('freeze', 'explorer', 2.0, 0.1, 3.0),
    'sensor killed': Fault('kill', 'sensor', 0.4),
    'feature_extractor killed': Fault('kill', 'feature_extractor', 0.4),
    'classifier killed': Fault('kill', 'classifier', 0.4),
    'explorer killed': Fault('kill', 'explorer', 0.4),
}
FLIPS = (1e-4, 2e-2)  # of a bit a byte: from a bad cable to a line on which hardly a packet is whole


@dataclass(frozen=True)
class PlannedFault:
    """One fault: after so much quiet, for so long; `strength` is the probability of a flipped bit."""

    name: str
    quiet_s: float
    hold_s: float
    strength: float

    @property
    def fault(self) -> Fault:
        """Its kind."""
        return FAULTS[self.name]


def planned_faults(rng: np.random.Generator, mean_quiet_s: float) -> Iterator[PlannedFault]:
    """Yield faults without end; the quiet before each is exponentially distributed."""
    names = list(FAULTS)
    weights = np.array([fault.weight for fault in FAULTS.values()])
    low, high = np.log(FLIPS)
    while True:
        name = names[int(rng.choice(len(names), p=weights / weights.sum()))]
        fault = FAULTS[name]
        hold_s = float(rng.uniform(fault.low_s, fault.high_s))
        yield PlannedFault(name, float(rng.exponential(mean_quiet_s)), hold_s, float(np.exp(rng.uniform(low, high))))
