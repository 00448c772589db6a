"""For how long nothing was heard while somebody listened."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Listening:
    """Since when the loop has listened, and its newest gap: a machine that slept says nothing about a sensor or an arm.

    Only the newest gap is left out of a silence. If every gap were, a busy machine whose steps are late again and again
    would never notice that an arm or a sensor is silent.

    Parameters
    ----------
    since_ns
        When listening began, ns of CLOCK_MONOTONIC; what was silent before does not count.
    gap_start_ns, gap_end_ns
        Newest gap between two steps of the loop, ns of the same clock; both 0 if there was none.

    Examples
    --------
    >>> listening = Listening(gap_start_ns=2_000_000_000, gap_end_ns=2_400_000_000)
    >>> listening.silence_s(heard_ns=1_900_000_000, now_ns=2_500_000_000)  # 0.1 s before the gap, 0.1 s after it
    0.2
    """

    since_ns: int = 0
    gap_start_ns: int = 0
    gap_end_ns: int = 0

    def silence_s(self, heard_ns: int, now_ns: int) -> float:
        """Return for how long nothing was heard, s, without the part of it that lies in the newest gap.

        Parameters
        ----------
        heard_ns
            When something was heard last, ns of CLOCK_MONOTONIC.
        now_ns
            Time now, ns of the same clock.

        Returns
        -------
        float
            0 or less if something was heard just now.
        """
        start_ns = max(heard_ns, self.since_ns)
        slept_ns = max(0, self.gap_end_ns - max(self.gap_start_ns, start_ns))
        return (now_ns - start_ns - slept_ns) * 1e-9


WITHOUT_GAPS = Listening()
