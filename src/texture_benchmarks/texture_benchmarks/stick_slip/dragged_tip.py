"""The drag that is simulated: friction, speed and force."""

from __future__ import annotations

from texture_simulation.stick_slip.friction import StickSlip

FRICTION = StickSlip()
SPEED_M_S, FORCE_N = 0.05, 1.5  # of the drag whose cost and error are measured
