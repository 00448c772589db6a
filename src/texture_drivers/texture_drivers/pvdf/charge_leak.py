"""A piezoelectric film in its amplifier: charge follows the force, and leaks away.

The charge obeys dQ/dt = d33 · dF/dt − Q / (R·C): a high-pass of first order,

    Q(s) / F(s) = d33 · s·T / (1 + s·T),    T = R·C,

whose answer to a step of the force is d33 · exp(−t / T). (F = Ω·σ3 is the force on the film of area Ω.)

Source: Hu et al. 2014, eq. 4 to 6.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array, Samples


@dataclass(frozen=True)
class ChargeLeak:
    """The film and its amplifier.

    Parameters
    ----------
    resistance_ohm, capacitance_f
        Equivalent resistance of the amplifier and capacitance of the film.
    d33_c_n
        Charge per force.
    """

    resistance_ohm: float
    capacitance_f: float
    d33_c_n: float = 21e-12  # the paper's film

    @property
    def time_constant_s(self) -> float:
        """T = R·C, after which a charge has leaked to 37 %."""
        return self.resistance_ohm * self.capacitance_f

    @property
    def corner_hz(self) -> float:
        """Frequency below which the film answers less and less."""
        return 1 / (2 * math.pi * self.time_constant_s)

    def response(self, frequency_hz: Array) -> NDArray[np.complex128]:
        """Return the charge per force at frequencies, (n,), C/N.

        Parameters
        ----------
        frequency_hz : (n,)
            At least 0.

        Returns
        -------
        (n,) complex
            C/N.
        """
        transfer = 2j * np.pi * frequency_hz * self.time_constant_s
        response: NDArray[np.complex128] = self.d33_c_n * transfer / (1 + transfer)
        return response


class LeakingFilm:
    """Force to charge, batch by batch; exact for a force that is constant between samples.

    Parameters
    ----------
    leak
        The film and its amplifier.
    rate_hz
        Of the samples.
    """

    def __init__(self, leak: ChargeLeak, rate_hz: float) -> None:
        self._gain = leak.d33_c_n
        self._pole = math.exp(-1 / (leak.time_constant_s * rate_hz))
        self._filter = FirstOrder((1.0, -1.0), (1.0, -self._pole))

    def update(self, force_n: Samples) -> Samples:
        """Return the charge, (n_samples, n_channels) C, for forces of the same shape; at rest before the first.

        Parameters
        ----------
        force_n : (n_samples, n_channels)
            Force on the film.

        Returns
        -------
        (n_samples, n_channels)
            Charge, C.
        """
        return self._gain * self._filter.update(force_n)


class ForceReconstructor:
    """Reconstruct the force from the charge, batch by batch: the inverse of `LeakingFilm` above a frequency.

    A constant force leaves no charge, so what lies far below the film's corner is lost for good, and a plain inverse
    would add up every offset for ever. This one is exact but for a high-pass of first order at `from_hz`.

    Parameters
    ----------
    leak, rate_hz
        As for `LeakingFilm`.
    from_hz
        Lowest frequency restored; below the film's corner, or nothing is gained.
    """

    def __init__(self, leak: ChargeLeak, rate_hz: float, from_hz: float) -> None:
        self._gain = 1 / leak.d33_c_n
        pole = math.exp(-1 / (leak.time_constant_s * rate_hz))
        restored_pole = math.exp(-2 * math.pi * from_hz / rate_hz)
        self._filter = FirstOrder((1.0, -pole), (1.0, -restored_pole))

    def update(self, charge_c: Samples) -> Samples:
        """Return the force, (n_samples, n_channels) N, for charges of the same shape; at rest before the first.

        Parameters
        ----------
        charge_c : (n_samples, n_channels)
            Charge of the film.

        Returns
        -------
        (n_samples, n_channels)
            Force, N.
        """
        return self._gain * self._filter.update(charge_c)

    def restart(self) -> None:
        """Forget the past: samples are missing."""
        self._filter.restart()


class FirstOrder:
    """A recursive filter of first order that goes on from batch to batch."""

    def __init__(self, numerator: tuple[float, float], denominator: tuple[float, float]) -> None:
        self._numerator, self._denominator = numerator, denominator
        self.restart()

    def restart(self) -> None:
        """Begin at rest."""
        self._state: Samples | None = None

    def update(self, samples: Samples) -> Samples:
        """Return the filtered samples, (n_samples, n_channels).

        Parameters
        ----------
        samples : (n_samples, n_channels)
            Follow those of the last call.

        Returns
        -------
        (n_samples, n_channels)
            In the unit of the samples.
        """
        from scipy.signal import lfilter  # noqa: PLC0415 – no other sensor needs scipy

        if self._state is None:
            self._state = np.zeros((1, samples.shape[1]))
        filtered, self._state = lfilter(self._numerator, self._denominator, samples, axis=0, zi=self._state)
        return np.asarray(filtered, dtype=np.float64)
