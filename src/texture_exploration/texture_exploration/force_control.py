"""Press with a wanted force by an arm that knows velocities alone.

The contact is a spring: F = k·(h − z), with h the height of the untouched surface under the finger. Each period T the
controller sets the normal velocity

    u = −g·(e + ∫e dt / Ti) + dh/dt,    e = F_wanted − F,

and it comes into effect after the loop delay. The feed-forward dh/dt is not the arm's own movement: z + F/k is h
whatever the controller does, so its slope is a disturbance that is observed, and adds no loop as far as k is right.
k is estimated while the finger comes into contact, and g follows from it: see `texture_exploration.stability`. The
delay is measured while it comes down; if it is longer than declared, gain and speed are reduced accordingly.
"""

from __future__ import annotations

import math
import statistics
from dataclasses import dataclass, replace

from texture_core.errors import InvalidParameter
from texture_core.parameters import param
from texture_exploration.lag import ForceLag, LagEstimate
from texture_exploration.slope_observer import SlopeObserver
from texture_exploration.stability import LoopModel, stability_limit_gain
from texture_exploration.stiffness import TOUCHING_N, StiffnessEstimate

NOISE_SHARE = 1.0 / 6.0  # of the force that counts as touching: the least noise of the force that is supposed
LEAST_NOISE = 0.1  # of that; a reading may also stand still
BEARABLE = 0.2  # of the wanted force, that noise may cost by what looks like a slope
NOISE_SAMPLES = 50  # a finger that is pressed or lifted changes its force more: the calmest so many tell the noise
SLOWEST_M_S = 0.001  # below, the finger is at rest along the surface
SETTLED = 0.3  # from an error of this share of the wanted force on, the slope is observed
REACTION_PERIODS = 2.0  # from contact to the first answer, beside the delay
LONGEST_DELAY_S = 0.1  # of `ForceLoopParams`
UNDECLARED_PERIODS = 1.5  # a lag that is longer than declared by more than this counts
LATE_IMPACT = (
    3.0  # so many times 'max_impact_n' may be met by an arm that is later than declared: coming down takes long
)
INTEGRAL_LAGS = 20.0  # the integral part takes at least so many lags: a faster one adds to the overshoot
FORCE_LAG_S = 0.03  # a force that is later than 'loop_delay_s' by more than this is not pressed by
NEAR_M = 0.001  # above a surface whose height is known, the finger slows down to closing speed


@dataclass(frozen=True)
class ForceLoopParams:
    """Parameters of the force control of an arm without a force mode."""

    loop_delay_s: float = param(
        0.008,
        'Sets the largest delay from a measured force to the motion that answers it; a larger value lowers the gain.',
        unit='s',
        low=0.0,
        high=0.1,
    )
    force_gain_m_s_n: float = param(
        0.0,
        'Sets the normal speed per force error; 0 derives it from the estimated contact stiffness. A larger'
        ' value settles faster and is less stable.',
        unit='m/s/N',
        low=0.0,
        high=1.0,
    )
    max_stiffness_n_m: float = param(
        5000.0,
        'Sets the stiffest contact of finger and surface that is expected; a larger value lowers the '
        'approach speed and the first gain.',
        unit='N/m',
        low=100.0,
        high=200000.0,
    )
    gain_margin: float = param(
        4.0,
        'Sets by which factor the gain stays below the stability limit; a larger factor is more stable and slower.',
        low=2.0,
        high=50.0,
    )
    integral_s: float = param(
        0.5,
        'Sets the time constant of the integral part; a longer time removes a constant force error more slowly.',
        unit='s',
        low=0.05,
        high=100.0,
    )
    force_speed_m_s: float = param(
        0.05,
        'Sets the highest normal speed under force control; a higher speed corrects force errors faster.',
        unit='m/s',
        low=0.001,
        high=0.25,
    )
    max_impact_n: float = param(
        0.15,
        'Sets the largest impact force on the stiffest surface before the arm can react; a larger force '
        'allows a faster approach.',
        unit='N',
        low=0.01,
        high=5.0,
    )

    press_impact_share: float = param(
        1.0,
        'Sets the largest impact on the stiffest base under a soft layer, while pressing at rest, as a '
        'share of the wanted force; a larger share presses faster.',
        low=0.05,
        high=100.0,
    )
    touching_n: float = param(
        TOUCHING_N,
        'Sets the force above which the force control takes the finger for touching; it must exceed the noise of the '
        'force sensor. A larger force meets the surface harder.',
        unit='N',
        low=0.005,
        high=5.0,
    )

    def loop(self, stiffness_n_m: float, period_s: float, gain_m_s_n: float = 0.0) -> LoopModel:
        """Return the closed loop on a contact.

        Parameters
        ----------
        stiffness_n_m
            Stiffness of the contact, N/m.
        period_s
            Time between two commands.
        gain_m_s_n
            Gain of the controller, m/s per N.

        Returns
        -------
        LoopModel
            With the delay and the integral time of these parameters.
        """
        return LoopModel(stiffness_n_m, gain_m_s_n, self.loop_delay_s, period_s, self.integral_s)

    def default_gain(self, stiffness_n_m: float, period_s: float) -> float:
        """Return the gain for a contact, m/s/N: below the stability limit by the margin."""
        return stability_limit_gain(self.loop(stiffness_n_m, period_s)) / self.gain_margin

    def check_gain(self, period_s: float) -> None:
        """Refuse a gain that is not stable on the stiffest contact.

        Raises
        ------
        InvalidParameter
            With the gain that would do.
        """
        limit = stability_limit_gain(self.loop(self.max_stiffness_n_m, period_s))
        if self.force_gain_m_s_n >= limit:
            raise InvalidParameter(
                f"parameter 'force_gain_m_s_n' is {self.force_gain_m_s_n:g}; on a contact of "
                f'{self.max_stiffness_n_m:g} N/m with a loop delay of '
                f'{1e3 * self.loop_delay_s:g} ms, once every {1e3 * period_s:g} ms, that is '
                f'unstable from {limit:.2g} m/s/N on; choose {limit / self.gain_margin:.2g}, or 0 to let it be chosen'
            )

    @property
    def max_impact_depth_m(self) -> float:
        """Impact per stiffness, m: how deep the finger may run into the stiffest surface."""
        return self.max_impact_n / self.max_stiffness_n_m


class ForceController:
    """The PI part, with a limit of the speed and no windup at it.

    Parameters
    ----------
    gain_m_s_n, integral_s
        See the head of this file.
    max_speed_m_s
        Of the answer.
    """

    def __init__(self, gain_m_s_n: float, integral_s: float, max_speed_m_s: float = math.inf) -> None:
        self._gain_m_s_n = gain_m_s_n
        self._integral_s = integral_s
        self._max_m_s = max_speed_m_s
        self._sum_ns = 0.0

    @property
    def gain_m_s_n(self) -> float:
        """Normal speed per force error, m/s/N."""
        return self._gain_m_s_n

    @gain_m_s_n.setter
    def gain_m_s_n(self, gain_m_s_n: float) -> None:
        # The integral part goes on at most at the speed that it has: what a hundredth of the gain added up is no error
        # now, and on a harder base less speed is wanted.
        self._sum_ns *= min(1.0, self._gain_m_s_n / gain_m_s_n)
        self._gain_m_s_n = gain_m_s_n

    def restart(self) -> None:
        """Forget the past errors."""
        self._sum_ns = 0.0

    def update(self, error_n: float, dt_s: float, feed_forward_m_s: float = 0.0, down_m_s: float = math.inf) -> float:
        """Return the normal velocity, positive away from the surface, for a force error, wanted less measured.

        Towards the surface it is at most `down_m_s`.

        Parameters
        ----------
        error_n
            Wanted less measured force, N; positive: press harder.
        dt_s
            Time since the last call.
        feed_forward_m_s
            Velocity with which the surface rises, m/s.
        down_m_s
            Largest speed towards the surface, m/s.

        Returns
        -------
        float
            Normal velocity, m/s, positive away from the surface.
        """
        added = self._sum_ns + error_n * dt_s
        wanted = feed_forward_m_s - self._gain_m_s_n * (error_n + added / self._integral_s)
        limited = min(self._max_m_s, max(-min(self._max_m_s, down_m_s), wanted))
        # Anti-windup: an error that only pushes further against the limit is not added up.
        if limited == wanted or (wanted > 0) == (error_n > 0):
            self._sum_ns = added
        return limited


@dataclass(frozen=True)
class ContactState:
    """State of the contact: height of the finger, distance travelled along the surface, force on the finger."""

    height_m: float
    travelled_m: float
    force_n: float


class ForceLoop:
    """Come down, estimate the stiffness, press with the wanted force: the force mode of an arm that has none.

    Parameters
    ----------
    params
        The loop.
    period_s
        How often `velocity_m_s` is called.

    Raises
    ------
    InvalidParameter
        If the loop would be unstable.
    """

    def __init__(self, params: ForceLoopParams, period_s: float) -> None:
        params.check_gain(period_s)
        self._params = params
        self._period_s = period_s
        self.stiffness = StiffnessEstimate(params.touching_n)
        self.lag = LagEstimate()
        self._declared = params  # what was declared; `_params` holds what was measured
        self._observer = self._new_observer()
        self._surface_m: float | None = None  # where the finger met it last
        self._chosen_for = math.nan
        self._forces: list[float] = []
        self._noise_n = math.inf
        self._touch: ForceLag | None = None  # while the finger stands after the first touch, to hear the force
        self._heard = False
        self.force_lag_s = 0.0
        self.controller = self._new_controller()

    def restart(self) -> None:
        """The finger is not under force control, or the command ended."""
        self.controller.restart()
        self._observer.restart()

    def observe(self, contact: ContactState, speed_m_s: float = 0.0) -> None:
        """Take note of a contact, whatever is commanded; call it once a period. Sliding tells nothing of stiffness."""
        self._note_noise(contact.force_n)
        if contact.force_n < self._params.touching_n:
            self.stiffness.restart()
            self._touch, self._heard = None, False
            return
        if self.stiffness.empty:
            self._surface_m = contact.height_m
        if speed_m_s > SLOWEST_M_S:
            self.stiffness.fixed = True
        self.stiffness.update(contact.height_m, contact.force_n)
        self._choose_gain()

    @property
    def noise_n(self) -> float:
        """Standard deviation of the force, N, as measured above the surface; what `touching_n` supposes until then."""
        supposed_n = NOISE_SHARE * self._params.touching_n
        return max(LEAST_NOISE * supposed_n, self._noise_n) if math.isfinite(self._noise_n) else supposed_n

    def asked(self, height_m: float, asked_m_s: float, dt_s: float) -> None:
        """Take note of the velocity that was asked for in the end: it tells how late the arm follows.

        Parameters
        ----------
        height_m
            Height of the finger when the velocity was asked for, m.
        asked_m_s
            Normal velocity, m/s, positive away from the surface.
        dt_s
            Time since the last call.
        """
        self.lag.update(height_m, asked_m_s, dt_s)
        if self.stiffness.empty:  # a gain is not changed in contact
            self._adapt_to_lag()

    def velocity_m_s(self, wanted_n: float, contact: ContactState, speed_m_s: float, dt_s: float) -> float:
        """Return the normal velocity that leads to a wanted force, at a commanded speed along the surface.

        Parameters
        ----------
        wanted_n
            Wanted force, N, above 0.
        contact
            Height, force and travelled distance, as measured.
        speed_m_s
            Commanded speed along the surface, m/s.
        dt_s
            Time since the last call.

        Returns
        -------
        float
            Normal velocity, m/s, positive away from the surface.
        """
        height_m, force_n = contact.height_m, contact.force_n
        if force_n < self._params.touching_n:
            self.restart()
            return -self.approach_m_s(height_m)
        if speed_m_s <= SLOWEST_M_S and not self._heard:
            self._listen(contact, dt_s)
            return 0.0
        estimated_n_m = self.stiffness.value_n_m
        settled = abs(wanted_n - force_n) < SETTLED * wanted_n
        feed_forward_m_s = 0.0
        if not math.isnan(estimated_n_m) and (settled or self._observer.running):
            feed_forward_m_s = self._observer.update(
                contact.travelled_m,
                height_m + force_n / estimated_n_m,
                speed_m_s,
                max(self.noise_n, NOISE_SHARE * self._params.touching_n) / estimated_n_m,
                self.noise_n / (BEARABLE * wanted_n),
            )
        down_m_s = math.inf if speed_m_s > SLOWEST_M_S else self._pressing_m_s(wanted_n)
        return self.controller.update(wanted_n - force_n, dt_s, feed_forward_m_s, down_m_s)

    def doubt(self) -> str:
        """Return in a sentence why nobody should press by this force, '' if one may."""
        allowed_s = FORCE_LAG_S + self._declared.loop_delay_s
        if self.force_lag_s <= allowed_s:
            return ''
        declared_ms = 1e3 * self._declared.loop_delay_s
        return (
            f'the force rose for {1e3 * self.force_lag_s:.0f} ms or more after the finger stood still on the surface, '
            f"and {1e3 * allowed_s:.0f} ms are allowed with a 'loop_delay_s' of {declared_ms:.0f} ms; find what makes "
            'the force late, such as a filter, or declare it'
        )

    def _listen(self, contact: ContactState, dt_s: float) -> None:
        """Stand until the force does, and take over how late it is, before anything is pressed."""
        self._touch = self._touch or ForceLag(self.noise_n)
        if not self._touch.update(contact.height_m, contact.force_n, dt_s):
            return
        self._heard = True
        self.force_lag_s = 0.0 if math.isnan(self._touch.value_s) else self._touch.value_s
        self._adapt_to_lag()
        self._choose_gain()

    def _note_noise(self, force_n: float) -> None:
        self._forces.append(force_n)
        if len(self._forces) == NOISE_SAMPLES:
            self._noise_n = min(self._noise_n, statistics.pstdev(self._forces))
            self._forces = []

    def _pressing_m_s(self, wanted_n: float) -> float:
        """Return how fast the finger may be pressed on: what is soft now may have a hard base."""
        depth_m = self._params.press_impact_share * wanted_n / self._declared.max_stiffness_n_m
        return depth_m * self._patience / self._reaction_s(self._params)

    def approach_m_s(self, height_m: float) -> float:
        """Return how fast the finger may come down: slowly where the surface may be."""
        params = self._params
        reaction_s = self._reaction_s(params)
        slow_m_s = min(params.force_speed_m_s, self._closing_m / reaction_s)
        if self._surface_m is None:
            return slow_m_s
        above_m = height_m - self._surface_m - NEAR_M
        return min(params.force_speed_m_s, max(slow_m_s, above_m / (4 * reaction_s)))

    @property
    def _closing_m(self) -> float:
        """How deep the finger may run into the surface before it reacts, m."""
        depth_m = self._declared.max_impact_depth_m
        estimated_n_m = self.stiffness.value_n_m
        if self._delayed and not self.stiffness.empty and not math.isnan(estimated_n_m):
            depth_m *= max(1.0, self._declared.max_stiffness_n_m / estimated_n_m)
        return depth_m * self._patience

    @property
    def _patience(self) -> float:
        """How many times harder than declared an arm that is later than declared may meet a surface."""
        return min(LATE_IMPACT, self._reaction_s(self._params) / self._reaction_s(self._declared))

    def _reaction_s(self, params: ForceLoopParams) -> float:
        return params.loop_delay_s + REACTION_PERIODS * self._period_s

    @property
    def _delayed(self) -> bool:
        return self._params.loop_delay_s > self._declared.loop_delay_s

    def _adapt_to_lag(self) -> None:
        """Take over the measured lag if it is longer than declared."""
        lag_s = self.lag.value_s + self.force_lag_s
        declared = self._declared
        late = lag_s > declared.loop_delay_s + UNDECLARED_PERIODS * self._period_s  # not if it is NaN
        delay_s = math.ceil(lag_s * 1e3) * 1e-3 if late else declared.loop_delay_s
        if delay_s == self._params.loop_delay_s:
            return
        integral_s = max(declared.integral_s, INTEGRAL_LAGS * delay_s) if late else declared.integral_s
        self._params = replace(declared, loop_delay_s=min(delay_s, LONGEST_DELAY_S), integral_s=integral_s)
        self._observer = self._new_observer()
        self.controller = self._new_controller()
        self._chosen_for = math.nan

    def _new_observer(self) -> SlopeObserver:
        return SlopeObserver(self._params.loop_delay_s + 0.5 * self._period_s)

    def _new_controller(self) -> ForceController:
        params = self._params
        gain = params.force_gain_m_s_n or params.default_gain(params.max_stiffness_n_m, self._period_s)
        return ForceController(gain, params.integral_s, params.force_speed_m_s)

    def _choose_gain(self) -> None:
        estimated_n_m = self.stiffness.value_n_m
        if self._params.force_gain_m_s_n or math.isnan(estimated_n_m) or estimated_n_m == self._chosen_for:
            return
        self._chosen_for = estimated_n_m
        self.controller.gain_m_s_n = self._params.default_gain(estimated_n_m, self._period_s)
