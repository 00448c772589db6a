"""The signals of a recording in a file."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.arrays import Samples


@dataclass(frozen=True, eq=False)
class FileRecording:
    """Samples from a file.

    Parameters
    ----------
    samples : (n_samples, n_channels)
    rate_hz
        None if the file does not tell.
    channels
        () if the file does not tell.
    """

    samples: Samples
    rate_hz: float | None = None
    channels: tuple[str, ...] = ()
