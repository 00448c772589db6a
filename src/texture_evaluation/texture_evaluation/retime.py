"""Slides as they would be at other speeds: the same way over the surface in another time."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path

from scipy.signal import resample_poly

from texture_core.arrays import Array
from texture_evaluation.datasets.steady_slides import SteadySlide, Stream, write_steady_slides
from texture_evaluation.whole_slides import WholeSlide, whole_slides

FINEST = 1000  # of the ratio of two speeds


def retimed(samples: Array, speed_m_s: float, wanted_m_s: float) -> Array:
    """Return samples (n, n_channels) taken at one speed as they would be at another, at the same rate.

    What frequency does to the sensor and to friction stays that of the speed they were taken at.
    """
    ratio = Fraction(speed_m_s / wanted_m_s).limit_denominator(FINEST)
    values: Array = resample_poly(samples, ratio.numerator, ratio.denominator, axis=0, padtype='line')
    return values


def write_retimed(
    bags: Iterable[str | Path], out: str | Path, speeds_m_s: Sequence[float], topic: str = 'signal', slides: str = ''
) -> list[Path]:
    """Write one bag a surface with each of its slides at each of these speeds, and return their paths.

    A model trained on them meets windows as long in distance as at these speeds. For sensors whose channels follow
    the surface; a vibration sensor of strong resonance is better taught at the speeds themselves.

    Parameters
    ----------
    bags, topic, slides
        Which slides, as `whole_slides` reads them.
    out
        Folder for the bags; made if missing.
    speeds_m_s
        Speeds to simulate.
    """
    surfaces: defaultdict[str, list[WholeSlide]] = defaultdict(list)
    for slide in whole_slides(bags, topic, slides):
        surfaces[slide.surface].append(slide)
    return [
        write_steady_slides(
            Path(out) / surface,
            Stream(topic, 'retimed', group[0].channels, '', group[0].rate_hz),
            (_at(slide, speed) for slide in group for speed in speeds_m_s),
        )
        for surface, group in sorted(surfaces.items())
    ]


def _at(slide: WholeSlide, speed_m_s: float) -> SteadySlide:
    return SteadySlide(
        f'{slide.slide.exploration_id}@{1000 * speed_m_s:g}mm_s', slide.surface,
        retimed(slide.samples, slide.speed_m_s, speed_m_s), speed_m_s, slide.force_n, slide.direction_rad,
    )  # fmt: skip
