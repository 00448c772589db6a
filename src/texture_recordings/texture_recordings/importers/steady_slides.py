"""Write slides of evenly spaced samples at a constant speed and force, as labelled bags."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from texture_core.arrays import AnyArray
from texture_core.exploration import ExplorationState, Phase
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_recordings.bag_writer import BagWriter

START_NS = 1_000_000_000 * NANOSECONDS
PAUSE_NS = NANOSECONDS
DELAY_NS = 100_000  # a batch is logged this long after its last sample
BATCH_S = 0.1


@dataclass(frozen=True, eq=False)
class SteadySlide:
    """One slide.

    Parameters
    ----------
    exploration_id, surface
        Name and label.
    samples : (n, n_channels)
        Evenly spaced.
    speed_m_s, force_n, direction_rad
        Of the finger; NaN if unknown.
    steady
        Samples in which the finger slides; before them it is in contact, after them it lifts. All if None.

    Examples
    --------
    >>> import numpy as np
    >>> SteadySlide('cork-1', 'cork', np.zeros((200, 1)), speed_m_s=0.05, force_n=1.0, direction_rad=0.0).surface
    'cork'
    """

    exploration_id: str
    surface: str
    samples: AnyArray
    speed_m_s: float
    force_n: float
    direction_rad: float
    steady: range | None = None


@dataclass(frozen=True)
class ImportedStream:
    """The stream that all slides of a data set share: as in a `TactileSignal`.

    Examples
    --------
    >>> ImportedStream('signal', 'finger', ('pac',), 'count', 100.0).to_ns(50)  # half a second
    500000000
    """

    topic: str
    sensor: str
    channels: tuple[str, ...]
    unit: str
    rate_hz: float

    def to_ns(self, samples: int) -> int:
        """Return how long so many samples take."""
        return round(samples * NANOSECONDS / self.rate_hz)


def write_steady_slides(path: Path, stream: ImportedStream, slides: Iterable[SteadySlide]) -> Path:
    """Write a bag of slides, one after the other in the order given; the stamps are made up.

    A state is published at the start of each phase and guarantees its whole length: speed and force do not change.

    Parameters
    ----------
    path
        Of the new bag.
    stream
        Topic, sensor, channels and rate of the samples.
    slides
        In the order of their writing.

    Returns
    -------
    Path
        Of the bag.
    """
    start_ns, first = START_NS, 0
    with BagWriter(path) as bag:
        for slide in slides:
            start_ns = _write(bag, stream, slide, start_ns, first) + PAUSE_NS
            first += len(slide.samples)
    return path


def _write(bag: BagWriter, stream: ImportedStream, slide: SteadySlide, start_ns: int, first: int) -> int:
    """Write one slide; return its end."""
    count = len(slide.samples)
    steady = slide.steady or range(count)
    phases = [(Phase.CONTACT, range(steady.start)), (Phase.SLIDE, steady), (Phase.LIFT, range(steady.stop, count))]
    named = ExplorationState(
        0, slide.exploration_id, 'linear_slide', Phase.SLIDE, speed_m_s=slide.speed_m_s, force_n=slide.force_n,
        direction_rad=slide.direction_rad, surface=slide.surface,
    )  # fmt: skip
    for phase, part in phases:
        if len(part) or phase is not Phase.CONTACT:
            _write_phase(bag, stream, slide, replace(named, phase=phase), part=part, start_ns=start_ns, first=first)
    end_ns = start_ns + stream.to_ns(count)
    bag.write('exploration', replace(named, stamp_ns=end_ns, phase=Phase.DONE, progress=1.0), end_ns + 2 * DELAY_NS)
    return end_ns


def _write_phase(
    bag: BagWriter,
    stream: ImportedStream,
    slide: SteadySlide,
    state: ExplorationState,
    *,
    part: range,
    start_ns: int,
    first: int,
) -> None:
    begin_ns, end_ns = (start_ns + stream.to_ns(index) for index in (part.start, part.stop))
    progress = part.start / len(slide.samples)
    # A state before the first batch it covers, and after the last batch of the phase before.
    log_ns = begin_ns + (DELAY_NS if part.start else 0)
    guaranteed_s = (end_ns - begin_ns) / NANOSECONDS
    bag.write('exploration', replace(state, stamp_ns=begin_ns, steady_s=guaranteed_s, progress=progress), log_ns)
    step = max(1, round(BATCH_S * stream.rate_hz))
    for index in range(part.start, part.stop, step):
        samples = slide.samples[index : min(index + step, part.stop)].astype('float32')
        stamp_ns = start_ns + stream.to_ns(index)
        batch = TactileSignal(
            stamp_ns,
            stream.sensor,
            stream.channels,
            (stream.unit,) * len(stream.channels),
            stream.rate_hz,
            first + index,
            samples,
            stream.sensor,
        )
        bag.write(stream.topic, batch, start_ns + stream.to_ns(index + len(samples)) + DELAY_NS)
