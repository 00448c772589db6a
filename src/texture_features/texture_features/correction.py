# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compare a finger with the one of the training by a slide over a reference plate, and correct for the difference."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.config import load_json, write_json
from texture_core.errors import InvalidData, ModelMismatch, counted
from texture_core.types import Array
from texture_features.windows import WindowBatch

# --------------------
# What one slide over the reference plate shows of an input.

BANDS = 48
SEGMENT_S = 0.25  # of a spectrum: resolves 4 Hz
MIN_SEGMENTS = 8  # of a slide: fewer leave the spectrum uncertain by more than 1 dB
SATURATED_FRACTION = 0.01  # samples of a channel at its lowest or highest value
DISTINCT = 100  # a channel with fewer values is too coarse
SIGNAL_TO_REST = 2.0  # least rms of the slide over that at rest
FLOOR = 1e-12
TRIMMED = 0.25  # of the segments of a slide, the lowest and as many highest of each band


@dataclass(frozen=True, eq=False)
class InputStatistics:
    """Statistics of one input over a slide on the reference plate and over the rest before its touch."""

    sensor: str
    rate_hz: float
    channels: tuple[str, ...]
    log_power: Array
    rms: Array
    rest_rms: Array
    rest_level: Array

    @classmethod
    def of(
        cls, samples: Array, rest: Array, rate_hz: float, channels: Sequence[str], sensor: str, *, weak: bool = False
    ) -> InputStatistics:
        """Measure them on samples while sliding, (n, n_channels), and at rest, (m, n_channels) or empty.

        Only a `weak` slide may be hardly above the rest.
        """
        length = round(SEGMENT_S * rate_hz)
        if len(samples) < 0.95 * MIN_SEGMENTS * length:  # one that was asked for as long may be a little shorter
            raise InvalidData(
                f'the slide over the plate lasts {len(samples) / rate_hz:.2f} s; slide for '
                f'{MIN_SEGMENTS * SEGMENT_S:g} s or longer'
            )
        for column in samples.T:
            values, counts = np.unique(column, return_counts=True)
            fraction = max(counts[0], counts[-1]) / len(column)
            if len(values) >= DISTINCT and fraction > SATURATED_FRACTION:
                raise InvalidData(
                    f'{100 * fraction:.0f} % of the samples of the slide over the plate are at the end of the range: '
                    'the sensor is saturated; press less, or lower its gain'
                )
        rms = samples.std(axis=0)
        quiet = np.full(samples.shape[1], math.nan)
        rest_rms, rest_level = quiet, quiet
        if len(rest) >= length:
            # Of the typical stretch: the arm may set off, or the level settle, in some.
            stretches = rest[: len(rest) // length * length].reshape(-1, length, rest.shape[1])
            rest_rms, rest_level = np.median(stretches.std(axis=1), axis=0), np.median(rest, axis=0)
        if not weak and float(np.median(rms)) < SIGNAL_TO_REST * float(np.median(rest_rms)):
            raise InvalidData(
                f'the slide over the plate has {np.median(rms):.3g} rms and the rest before it '
                f'{np.median(rest_rms):.3g}: too little signal; see that the finger touches the plate, or slide faster '
                'or harder'
            )
        from scipy.stats import trim_mean  # noqa: PLC0415  # takes 0.5 s, and every node imports this module

        starts = np.arange(0, len(samples) - length + 1, length // 2)
        segments = np.stack([samples[start : start + length] for start in starts])
        segments = (segments - segments.mean(axis=1, keepdims=True)) * np.hanning(length)[:, None]
        power = np.abs(np.fft.rfft(segments, axis=1)) ** 2 / length / rate_hz
        edges = np.linspace(1, power.shape[1], min(BANDS, power.shape[1] - 1) + 1).astype(int)  # without the mean
        # Of the typical segments: a jerk of the arm in some shows nothing about the finger.
        bands = trim_mean(np.add.reduceat(power, edges[:-1], axis=1) / np.diff(edges)[:, None], TRIMMED, axis=0)
        return cls(sensor, rate_hz, tuple(channels), np.log(bands + FLOOR), rms, rest_rms, rest_level)

    @property
    def frequencies_hz(self) -> Array:
        """Middle of each band, Hz, (n_bands,)."""
        count = len(self.log_power)
        return (np.arange(count) + 0.5) * self.rate_hz / 2 / count

    def as_mapping(self) -> dict[str, Any]:
        """Return it in the form of JSON."""
        # JSON has no NaN: what was not measured is null, which numpy reads as NaN.
        return {
            name: np.where(np.isnan(value), np.array(None), value).tolist() if isinstance(value, np.ndarray) else value
            for name, value in asdict(self).items()
        }

    @classmethod
    def from_mapping(cls, content: Mapping[str, Any]) -> InputStatistics:
        """Return what `as_mapping` wrote; ValueError, TypeError or KeyError if it is something else."""
        arrays = {
            name: np.array(content[name], dtype=np.float64) for name in ('log_power', 'rms', 'rest_rms', 'rest_level')
        }
        channels = tuple(map(str, content['channels']))
        return cls(str(content['sensor']), float(content['rate_hz']), channels, **arrays)


# --------------------
# The same finger, or another: what differs, and by what its samples become those of the finger of the training.

# Largest that count as trained. 78 slides of one finger over three plates, by two arms of the emulator, idle and beside
# two busy programs, differed from one another by at most 1.24 dB in gain and 0.81 dB rms in response.
GAIN_DB, RESPONSE_DB, NOISE_RATIO, DRIFT, DEAD = 1.5, 1.0, 2.0, 3.0, 0.1
STIFFNESS = 30.0  # of the curve through the differences of the bands: about 8 free numbers over 48 bands
DB = 10.0 / math.log(10.0)


@dataclass(frozen=True, eq=False)
class InputComparison:
    """How one input differs from the reference."""

    frequencies_hz: Array
    gain_db: Array
    response_db: Array
    noise_ratio: float
    drift: float
    dead: tuple[str, ...]

    @property
    def rest_is_known(self) -> bool:
        """Whether noise and drift were measured."""
        return math.isfinite(self.noise_ratio) and math.isfinite(self.drift)

    @property
    def uneven_db(self) -> float:
        """Difference of the frequency response without the gain, dB rms."""
        return float(np.sqrt(np.mean((self.response_db - self.gain_db) ** 2)))

    @property
    def faults(self) -> list[str]:
        """What is not as trained, each in a few words; none if all that was measured is."""
        uneven = self.response_db - self.gain_db
        uneven_db, gain_db = self.uneven_db, float(np.median(self.gain_db))
        at = np.unravel_index(np.abs(uneven).argmax(), uneven.shape)
        found = {
            f'the gain changed by {gain_db:+.1f} dB': abs(gain_db) > GAIN_DB,
            f'the frequency response differs by {uneven_db:.1f} dB rms, most at {self.frequencies_hz[at[0]]:.0f} Hz '
            f'({uneven[at]:+.1f} dB)': uneven_db > RESPONSE_DB,
            f'the noise at rest is {self.noise_ratio:.1f} times as strong': self.noise_ratio > NOISE_RATIO,
            f'the level at rest drifted by {self.drift:.1f} times the rms of the slide': self.drift > DRIFT,
            f'dead: {", ".join(self.dead)}': bool(self.dead),
        }
        return [fault for fault, is_there in found.items() if is_there]


def compare(reference: InputStatistics, today: InputStatistics) -> InputComparison:
    """Return how a finger differs from the one of the training.

    Raises
    ------
    InvalidData
        If they are of different sensors.
    """
    ours, theirs = (
        (one.sensor, f'{one.rate_hz:g} Hz', counted(len(one.channels), 'channel')) for one in (today, reference)
    )
    if ours != theirs:
        raise InvalidData(
            f'the reference is of the sensor {", ".join(theirs)}, and this one is {", ".join(ours)}; check the sensor '
            'that the model was trained with, or store a reference of this one'
        )
    difference_db = DB * (today.log_power - reference.log_power)
    ratio = today.rms / np.maximum(reference.rms, FLOOR)
    dead = ratio < DEAD * float(np.median(ratio))
    count = len(difference_db)
    bend = np.diff(np.eye(count), n=2, axis=0)
    smoother = np.linalg.inv(np.eye(count) + STIFFNESS * bend.T @ bend)
    with np.errstate(invalid='ignore'):
        noise = today.rest_rms / np.maximum(reference.rest_rms, FLOOR)
        drift = np.abs(today.rest_level - reference.rest_level) / np.maximum(reference.rms, FLOOR)
    return InputComparison(
        frequencies_hz=reference.frequencies_hz,
        gain_db=difference_db.mean(axis=0),
        response_db=smoother @ np.where(dead, 0.0, difference_db),
        noise_ratio=float(np.median(noise)),
        drift=float(np.median(drift)),
        dead=tuple(name for name, is_dead in zip(today.channels, dead, strict=True) if is_dead),
    )


@dataclass(frozen=True, eq=False)
class Correction:
    """By topic, the frequency response that is taken out of the samples of each window; levels stay."""

    frequencies_hz: Mapping[str, Array]
    response_db: Mapping[str, Array]

    @property
    def fingerprint(self) -> str:
        """Identifies it among other corrections."""
        return hashlib.sha256(json.dumps(self.as_mapping(), sort_keys=True).encode()).hexdigest()[:8]

    def noise_gain(self, topic: str) -> float:
        """Return by how much the noise at rest may be amplified: a finger that is less sensitive has the same noise."""
        return max(1.0, float(np.sqrt(np.mean(10.0 ** (-self.response_db.get(topic, np.zeros(1)) / 10.0)))))

    def as_mapping(self) -> dict[str, Any]:
        """Return it in the form of JSON."""
        return {
            topic: {'frequencies_hz': self.frequencies_hz[topic].tolist(), 'response_db': response.tolist()}
            for topic, response in self.response_db.items()
        }

    def apply(self, topic: str, window: WindowBatch) -> WindowBatch:
        """Return a window as the finger of the training would have measured it."""
        if topic not in self.response_db:
            return window
        response_db = self.response_db[topic]
        if response_db.shape[1] != window.samples.shape[-1]:
            raise InvalidData(
                f"the correction of '{topic}' is for {counted(response_db.shape[1], 'channel')}, and a window has "
                f'{window.samples.shape[-1]}; check the finger again'
            )
        count = window.samples.shape[-2]
        hertz = np.fft.rfftfreq(count, 1.0 / window.rate_hz)
        factors = 10.0 ** (
            -np.stack([np.interp(hertz, self.frequencies_hz[topic], column) for column in response_db.T], axis=1) / 20.0
        )
        factors[0] = 1.0
        samples = np.fft.irfft(np.fft.rfft(window.samples, axis=-2) * factors, count, axis=-2)
        return replace(window, samples=samples)

    @classmethod
    def of(cls, found: Mapping[str, InputComparison]) -> Correction:
        """Return what takes out the differences that were found, by topic."""
        return cls(
            {topic: one.frequencies_hz for topic, one in found.items()},
            {topic: one.response_db for topic, one in found.items()},
        )


# --------------------
# The files next to a model: what the finger of the training showed, and by what another one is corrected.

CORRECTION, REFERENCE = 'correction', 'reference'
SLIDE_NUMBERS = ('speed_m_s', 'force_n', 'distance_m', 'direction_rad')  # by which a slide over the plate is repeated
MOST_BYTES = 4_000_000
CORRECTED = ' corrected='  # before the fingerprint of a correction, in that of features


def file_next_to(model: str | Path, kind: str) -> Path:
    """Return the path NAME.reference.json or NAME.correction.json of a model, by the path of any of its files."""
    path = Path(model)
    name = path.name.removesuffix('.npz').removesuffix('.json')
    return path.with_name(f'{name}.{kind}.json')


def read_correction(model: str | Path) -> Correction | None:
    """Return the correction next to a model; None if there is none."""
    path = file_next_to(model, CORRECTION)
    if not path.exists():
        return None
    try:
        content = load_json(path, MOST_BYTES)
        frequencies_hz, response_db = (
            {str(topic): np.array(one[key], dtype=np.float64) for topic, one in content.items()}
            for key in ('frequencies_hz', 'response_db')
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ModelMismatch(
            f"correction '{path}' cannot be used: {error}; remove it, and check the finger again"
        ) from error
    return Correction(frequencies_hz, response_db)


def write_reference(model: str | Path, inputs: Mapping[str, InputStatistics], slide: Mapping[str, float]) -> Path:
    """Store what the finger of the training showed on the plate, by topic, and how it slid; return the path."""
    path = file_next_to(model, REFERENCE)
    write_json({'slide': dict(slide), 'inputs': {topic: one.as_mapping() for topic, one in inputs.items()}}, path)
    return path


def read_reference(model: str | Path) -> tuple[dict[str, InputStatistics], dict[str, float]]:
    """Return what the finger of the training showed on the reference plate, by topic, and how it slid.

    The numbers are those of the request that repeats the slide; none if it was not straight.
    """
    path = file_next_to(model, REFERENCE)
    if not path.exists():
        if not path.with_name(f'{path.name.removesuffix(f".{REFERENCE}.json")}.json').exists():
            raise ModelMismatch(f"there is no model '{model}'; give the path of a trained one")
        raise ModelMismatch(
            f"no reference is stored: '{path}' does not exist; slide over the reference plate "
            f'with the finger that it was trained with, and store that slide by `texture check {model} --store`'
        )
    try:
        content = load_json(path, MOST_BYTES)
        numbers = {str(name): float(value) for name, value in content['slide'].items()}
        return {str(topic): InputStatistics.from_mapping(one) for topic, one in content['inputs'].items()}, numbers
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ModelMismatch(f"reference '{path}' cannot be used: {error}; store it again by --store") from error
