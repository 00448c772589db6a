"""What makes a fingertip stick and slip: the friction of a surface and the skin that drags the tip over it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texture_core.errors import InvalidParameter
from texture_core.parameters import param

# A fading bristle damping gives power back nowhere if no speed u has damping(u)·|u| > 4·friction(u); exp(−x²)·x is at
# most 1/√(2e), so damping·stribeck ≤ 4·√(2e)·kinetic is enough.
PASSIVE = 4 * math.sqrt(2 * math.e)


@dataclass(frozen=True)
class StickSlip:
    """Friction by LuGre bristles with a Stribeck curve, and a tip of some mass on the spring and damper of the skin.

    All friction is proportional to the normal force, so stiffness and damping of the bristles are given for 1 N. The
    values are guesses of the order of what is published for fingertips and silicone on smooth surfaces.

    Raises
    ------
    InvalidParameter
        If the friction could give out more work than it took in (`PASSIVE`), or falls below the sliding one at rest.
    """

    static: float = param(
        0.9, 'Sets the coefficient of static friction at which a sticking tip starts to slip.', low=0.0, high=5.0
    )
    kinetic: float = param(0.5, 'Sets the coefficient of kinetic friction of fast sliding.', low=1e-3, high=5.0)
    stribeck_m_s: float = param(
        0.05,
        'Sets the Stribeck speed over which friction falls from static to kinetic; a larger value falls more slowly.',
        unit='m/s',
        low=1e-4,
        high=10.0,
    )
    viscous_s_m: float = param(
        0.0, 'Sets the growth of the coefficient of friction per speed.', unit='s/m', low=0.0, high=100.0
    )
    bristle_1_m: float = param(
        1.5e5,
        'Sets the bristle stiffness per normal force; a larger value bends the bristles less.',
        unit='1/m',
        low=1e2,
        high=1e8,
    )
    bristle_s_m: float = param(
        10.0,
        'Sets the bristle damping per normal force; a larger value damps small motions more.',
        unit='s/m',
        low=0.0,
        high=1e4,
    )
    skin_n_m: float = param(
        1000.0,
        'Sets the tangential stiffness of the skin; a larger value makes the stick phases shorter.',
        unit='N/m',
        low=1.0,
        high=1e6,
    )
    skin_n_s_m: float = param(
        0.4,
        'Sets the tangential damping of the skin; a larger value damps the slip phases more.',
        unit='N s/m',
        low=0.0,
        high=1e3,
    )
    mass_kg: float = param(
        5e-4,
        'Sets the moving mass of the skin; a larger value makes the slip phases longer.',
        unit='kg',
        low=1e-6,
        high=1.0,
    )
    force_coupling: float = param(
        0.2,
        'Sets the measured force per tangential force on the skin; a larger value shows friction more strongly.',
        low=-10.0,
        high=10.0,
    )
    step_s: float = param(
        2.5e-4,
        'Sets the longest integration step; a shorter step is more exact and costs more computing time.',
        unit='s',
        low=1e-7,
        high=0.1,
    )

    def __post_init__(self) -> None:
        if self.static < self.kinetic:
            raise InvalidParameter(
                f'static friction {self.static} is below the kinetic one, {self.kinetic}; give at least as much'
            )
        most = PASSIVE * self.kinetic / self.stribeck_m_s
        if self.bristle_s_m > most:
            raise InvalidParameter(
                f'bristle_s_m is {self.bristle_s_m} s/m; more than {most:.3g} (9.33·kinetic/stribeck_m_s) would give '
                'out work that was never put in; lower it'
            )

    @property
    def passive_step_s(self) -> float:
        """Up to this step the default integrator provably never adds energy: damping over stiffness of the skin."""
        return self.skin_n_s_m / self.skin_n_m
