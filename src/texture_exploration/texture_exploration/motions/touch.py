"""How the finger comes to the surface, presses and leaves: the same for every motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texture_core.parameters import param
from texture_exploration.motions.path import ramp_s

REACTION_S = 0.03  # from contact to standstill: two states of the arm, two steps of the exploration
IMPACT = 0.8  # of the wanted force
HARMLESS_N = 0.5  # a smaller force is not approached more slowly for what an arm does that hears nothing


@dataclass(frozen=True)
class TouchParams:
    """Parameters of approach, contact, acceleration and lift."""

    travel_speed_m_s: float = param(
        0.05,
        'Sets the highest speed above the surface on the way back to the start; a stiff contact may ask for a lower '
        'one.',
        unit='m/s',
        low=0.01,
        high=1.0,
    )
    approach_speed_m_s: float = param(
        0.02,
        'Sets the highest speed towards the surface; the wanted force may ask for a lower one.',
        unit='m/s',
        low=0.001,
        high=0.1,
    )
    approach_stiffness_n_m: float = param(
        2000.0,
        'Sets the stiffest contact that is expected; a larger value lowers the approach speed, so that the '
        'impact stays below the wanted force.',
        unit='N/m',
        low=10.0,
        high=200000.0,
    )
    approach_travel_m: float = param(
        0.05,
        'Sets how far the finger comes down in search of the surface before the motion is aborted.',
        unit='m',
        low=0.001,
        high=0.5,
    )
    unheard_force_share: float = param(
        1.5,
        'Sets the highest force of the approach, as a share of the wanted one, on an arm that only its watchdog stops; '
        'a smaller share lowers the approach speed.',
        low=0.2,
        high=10.0,
    )
    contact_force_n: float = param(
        0.2,
        'Sets the force above which the finger counts as in contact; a larger force needs a harder touch.',
        unit='N',
        low=0.02,
        high=5.0,
    )
    force_tolerance: float = param(
        0.1,
        'Sets the share of the wanted force within which the force has settled; a larger share settles sooner.',
        low=0.01,
        high=0.5,
    )
    speed_tolerance: float = param(
        0.05,
        'Sets the share of the wanted speed within which the speed is reached; a larger share starts the slide sooner.',
        low=0.005,
        high=0.5,
    )
    settle_s: float = param(
        0.1,
        'Sets how long the force must stay within its tolerance before the finger starts to slide.',
        unit='s',
        low=0.0,
        high=2.0,
    )
    acceleration_m_s2: float = param(
        1.0,
        'Sets the highest tangential acceleration; a larger value shortens the ramps before and after a slide.',
        unit='m/s²',
        low=0.05,
        high=10.0,
    )
    jerk_m_s3: float = param(
        50.0,
        'Sets the highest tangential jerk; a larger value shortens the ramps before and after a slide.',
        unit='m/s³',
        low=1.0,
        high=1000.0,
    )
    arm_lag_s: float = param(
        0.005,
        'Sets the time after which the arm follows a command; the direction on a curved path is led by it.',
        unit='s',
        low=0.0,
        high=0.1,
    )
    lost_force_share: float = param(
        0.25,
        'Sets the share of the wanted force below which contact counts as lost during a slide; a larger '
        'share aborts sooner.',
        low=0.05,
        high=0.9,
    )
    lost_contact_s: float = param(
        0.1,
        'Sets how long contact may be lost before the slide ends; shorter gaps are bounces on a rough surface.',
        unit='s',
        low=0.02,
        high=5.0,
    )
    seek_lost_contact: bool = param(
        False, 'Stops where contact was lost, comes down again and goes on, up to 3 times; false aborts.'
    )
    stall_speed_share: float = param(
        0.25,
        'Sets the share of the commanded way below which a sliding finger counts as stalled; a larger share aborts '
        'sooner.',
        low=0.05,
        high=0.9,
    )
    stall_s: float = param(
        0.25,
        'Sets the time over which the commanded way and that of the finger are compared during a slide; a longer time '
        'notices a stall later.',
        unit='s',
        low=0.05,
        high=5.0,
    )
    mean_force_share: float = param(
        0.3,
        'Sets the largest relative error of the mean measured force with which a slide succeeds.',
        low=0.05,
        high=1.0,
    )
    peak_force_share: float = param(
        0.5,
        'Sets by which share of the wanted force a slide may be pressed harder for a moment and succeed; states beyond '
        'it are not steady. A larger share bears a rougher surface.',
        low=0.05,
        high=20.0,
    )
    mean_speed_share: float = param(
        0.2,
        'Sets the largest relative error of the mean speed with which a slide succeeds.',
        low=0.02,
        high=5.0,
    )
    peak_speed_share: float = param(
        0.5,
        'Sets by which share of the wanted speed the finger may be faster for 50 ms in a slide that succeeds; states '
        'beyond it are not steady.',
        low=0.05,
        high=20.0,
    )
    mean_friction: float = param(
        2.0,
        'Sets the largest mean force along the surface, as a multiple of the wanted force, with which a slide '
        'succeeds; it counts where the arm measures that force.',
        low=0.1,
        high=50.0,
    )
    peak_friction: float = param(
        3.0,
        'Sets the largest force along the surface for 50 ms, as a multiple of the wanted force, with which a slide '
        'succeeds; states beyond it are not steady.',
        low=0.1,
        high=50.0,
    )
    lift_speed_m_s: float = param(
        0.05,
        'Sets the speed away from the surface; a higher speed leaves the surface sooner.',
        unit='m/s',
        low=0.005,
        high=0.5,
    )
    clearance_m: float = param(
        0.005, 'Sets the least height by which the finger is lifted after a contact.', unit='m', low=0.001, high=0.1
    )

    def approach_m_s(self, force_n: float, watchdog_s: float = 0.0) -> float:
        """Return how fast the finger may come down to press with a force.

        An arm that loses its commands just as it reacts to the contact goes on for the time of its watchdog. Until then
        the force stays below `unheard_force_share` of the wanted one on a contact of `approach_stiffness_n_m`.

        Parameters
        ----------
        force_n
            The wanted force.
        watchdog_s
            See `texture_exploration.arms.protocol.ArmState`.
        """
        heard_m_s = IMPACT * force_n / (self.approach_stiffness_n_m * REACTION_S)
        allowed_n = max(self.unheard_force_share * force_n, HARMLESS_N)
        unheard_m_s = allowed_n / (self.approach_stiffness_n_m * (watchdog_s + REACTION_S)) if watchdog_s else math.inf
        return min(self.approach_speed_m_s, heard_m_s, unheard_m_s)

    def travel_m_s(self, limit_n: float) -> float:
        """Return how fast the finger may go where something may stand in its way, for an impact below a force."""
        return min(self.travel_speed_m_s, limit_n / (self.approach_stiffness_n_m * REACTION_S))

    def ramp_s(self, speed_m_s: float) -> float:
        """Return how long it takes to gain or lose a speed."""
        return ramp_s(speed_m_s, self.acceleration_m_s2, self.jerk_m_s3)
