"""How the finger comes to the surface, presses and leaves: the same for every motion."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param
from texture_exploration.motions.path import ramp_s

REACTION_S = 0.03  # from contact to standstill: two states of the arm, two steps of the exploration
IMPACT = 0.8  # of the wanted force


@dataclass(frozen=True)
class TouchParams:
    """How the finger comes to the surface, presses, gains speed and leaves."""

    travel_speed_m_s: float = param(0.2, 'Speed above the surface, back to the start.', unit='m/s', low=0.01, high=1.0)
    approach_speed_m_s: float = param(0.02, 'Highest speed towards the surface.', unit='m/s', low=0.001, high=0.1)
    approach_stiffness_n_m: float = param(
        2000.0,
        'Stiffest contact expected: so slowly it is met that the wanted force is not passed before the arm can react.',
        unit='N/m',
        low=10.0,
        high=200000.0,
    )
    approach_travel_m: float = param(0.05, 'Give up when no surface was met within.', unit='m', low=0.001, high=0.5)
    contact_force_n: float = param(0.2, 'Force that counts as contact.', unit='N', low=0.02, high=5.0)
    force_tolerance: float = param(0.1, 'The force has settled within this share.', low=0.01, high=0.5)
    speed_tolerance: float = param(0.05, 'The speed is reached within this share.', low=0.005, high=0.5)
    settle_s: float = param(0.1, 'So long the force must stay within its tolerance.', unit='s', low=0.0, high=2.0)
    acceleration_m_s2: float = param(
        1.0, 'Highest acceleration when gaining or losing speed along the surface.', unit='m/s²', low=0.05, high=10.0
    )
    jerk_m_s3: float = param(50.0, 'Highest jerk of the same.', unit='m/s³', low=1.0, high=1000.0)
    arm_lag_s: float = param(0.005, 'The arm follows a command after.', unit='s', low=0.0, high=0.1)
    lost_force_share: float = param(
        0.25, 'While sliding, a force below this share of the wanted one counts as no contact.', low=0.05, high=0.9
    )
    lost_contact_s: float = param(
        0.1,
        'Contact lost for longer ends the slide; shorter gaps are bounces on a rough surface.',
        unit='s',
        low=0.02,
        high=5.0,
    )
    seek_lost_contact: bool = param(
        False, 'Stop where contact was lost, come down again and go on, up to 3 times; false: abort.'
    )
    mean_force_share: float = param(
        0.3, 'A slide whose mean measured force differs by more than this share ends as aborted.', low=0.05, high=1.0
    )
    lift_speed_m_s: float = param(0.05, 'Speed away from the surface.', unit='m/s', low=0.005, high=0.5)
    clearance_m: float = param(0.005, 'The finger is lifted at least so far.', unit='m', low=0.001, high=0.1)

    def approach_m_s(self, force_n: float) -> float:
        """Return how fast the finger may come down to press with a force."""
        return min(self.approach_speed_m_s, IMPACT * force_n / (self.approach_stiffness_n_m * REACTION_S))

    def ramp_s(self, speed_m_s: float) -> float:
        """Return how long it takes to gain or lose a speed."""
        return ramp_s(speed_m_s, self.acceleration_m_s2, self.jerk_m_s3)
