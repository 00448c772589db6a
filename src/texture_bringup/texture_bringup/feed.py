# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The newest messages of the nodes in bounded memory, as the dashboard and `texture watch` show them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_bringup.launcher import MAY_PRESS, PRESSES
from texture_core.types import (
    ENDED,
    ExplorationState,
    ModelInfo,
    Phase,
    Rejection,
    RoughnessEstimate,
    TactileSignal,
    TextureEstimate,
)

# --------------------
# One status indicator per node: green, yellow or red; red if it is silent, grey if it has ended.

SILENT_S = 5.0  # nodes report once a second
MAX_LIGHTS = 64
MAX_CHARACTERS = 300
ENDED_COLOURS = {'OK': 'grey', 'WARN': 'yellow', 'ERROR': 'red'}
COLOURS = {'OK': 'green', 'WARN': 'yellow', 'ERROR': 'red'}


class NodeStatuses:
    """Keep the last status of each node."""

    def __init__(self) -> None:
        # Level, message, time (of a clock that only rises, s), and whether the node has ended with that.
        self._lights: dict[str, tuple[str, str, float, bool]] = {}

    def update(self, name: str, level: str, message: str, time_s: float, ended: bool = False) -> None:
        """Note a report; above MAX_LIGHTS nodes the one that is silent for longest is removed."""
        self._lights.pop(name, None)
        self._lights[name[:MAX_CHARACTERS]] = level, message[:MAX_CHARACTERS], time_s, ended
        if len(self._lights) > MAX_LIGHTS:
            del self._lights[next(iter(self._lights))]

    def newest(self, name: str) -> tuple[str, str] | None:
        """Return level and message of the last status of a node; None if there is none."""
        return self._lights[name][:2] if name in self._lights else None

    def shown(self, time_s: float) -> list[dict[str, Any]]:
        """Return name, colour and message of each status indicator, by name, and whether its node is there."""
        found = []
        for name, (level, message, reported_s, ended) in sorted(self._lights.items()):
            colour, text = COLOURS.get(level, 'red'), message
            if ended:
                colour, text = ENDED_COLOURS.get(level, 'red'), f'ended: {message}'
            elif time_s - reported_s > SILENT_S:
                colour, text = 'red', f'silent for {time_s - reported_s:.0f} s; its last message: {message}'
                text += f'; {PRESSES}' * (name == 'explorer')
            found.append({'name': name, 'colour': colour, 'message': text, 'there': text == message})
        return found


# --------------------
# The newest samples of one stream, and how they are drawn with few numbers.

MAX_SAMPLES = 100_000


class Ring:
    """Keep the newest samples of the first channel of a stream."""

    def __init__(self, length_s: float) -> None:
        self._length_s = length_s
        self._samples: NDArray[np.float64] = np.zeros(0)  # of the whole length, NaN where none came yet
        self.last: TactileSignal | None = None  # batch

    def update(self, signal: TactileSignal) -> None:
        """Append a batch; a stream of another sensor or rate starts again, lost samples leave a gap of NaN."""
        last, self.last = self.last, signal
        fresh = signal.samples[:, 0].astype(np.float64)
        if last is None or (signal.sensor, signal.sampling_rate_hz) != (last.sensor, last.sampling_rate_hz):
            size = int(np.clip(round(self._length_s * signal.sampling_rate_hz), 1, MAX_SAMPLES))
            self._samples = np.full(size, np.nan)
        elif (gap := signal.first_sample - last.next_sample) > 0:
            fresh = np.concatenate([np.full(min(gap, len(self._samples)), np.nan), fresh])
        self._samples = np.concatenate([self._samples, fresh])[-len(self._samples) :]

    def newest(self, length_s: float) -> NDArray[np.float64]:
        """Return the newest samples, (n_samples,), oldest first; NaN where none came yet."""
        rate_hz = self.last.sampling_rate_hz if self.last else 0.0
        count = min(len(self._samples), round(length_s * rate_hz))
        return self._samples[len(self._samples) - count :]


def envelope(samples: NDArray[np.float64], points: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the least and the greatest sample of `points` stretches: no peak is lost, however few are drawn."""
    points = min(points, len(samples))
    if points == 0:
        return np.zeros(0), np.zeros(0)
    edges = np.linspace(0, len(samples), points, endpoint=False).astype(int)
    return np.fmin.reduceat(samples, edges), np.fmax.reduceat(samples, edges)


def spectrum_db(samples: NDArray[np.float64], bins: int) -> NDArray[np.float64]:
    """Return the amplitude from 0 Hz to half the rate in dB of one unit, the greatest of each bin; empty if gaps.

    A sine of amplitude 1 reads 0 dB (Hann window, its gain taken out).
    """
    if len(samples) < 16 or not np.isfinite(samples).all():
        return np.zeros(0)
    window = np.hanning(len(samples))
    amplitude = 2.0 * np.abs(np.fft.rfft(window * (samples - samples.mean()))) / window.sum()
    bins = min(bins, len(amplitude))
    edges = np.linspace(0, len(amplitude), bins, endpoint=False).astype(int)
    levels: NDArray[np.float64] = 20.0 * np.log10(np.maximum(np.maximum.reduceat(amplitude, edges), 1e-6))
    return levels


# --------------------
# The image of the slow channels: the difference of each from its level without contact, and its position.

PLACE = re.compile(r'.*_(\d+)_(\d+)')  # 'taxel_6_3': row and column
MAX_CHANNELS = 1024
RESTING_WEIGHT = 0.05  # of a batch in the resting value: follows a drift of seconds, not a touch
LEAST_NOISES = 10.0  # range of the colours in standard deviations of the noisiest channel, so that noise stays pale


class Taxels:
    """Keep the newest image and the resting one."""

    def __init__(self) -> None:
        self.channels: tuple[str, ...] = ()
        self.places: list[tuple[int, int]] = []
        self.unit = ''
        self._resting: NDArray[np.float64] = np.zeros(0)
        self._newest: NDArray[np.float64] = np.zeros(0)
        self._power: NDArray[np.float64] = np.zeros(0)  # of the noise of each channel

    def update(self, signal: TactileSignal, touching: bool) -> None:
        """Take the newest sample; while nothing is touched it moves the resting image."""
        newest = signal.samples[-1:, :MAX_CHANNELS].astype(np.float64)
        if not len(newest):
            return
        if signal.channels[:MAX_CHANNELS] != self.channels:
            self.channels, self.unit = signal.channels[:MAX_CHANNELS], signal.common_unit
            self.places = places_of(self.channels)
            self._resting, self._power = newest[0], np.zeros(newest.shape[1])
        self._newest = newest[0]
        if not touching:
            known = np.where(np.isfinite(self._resting), self._resting, self._newest)
            step = np.nan_to_num(self._newest - known, posinf=0.0, neginf=0.0)
            self._resting = known + RESTING_WEIGHT * step
            self._power += RESTING_WEIGHT * np.where(np.isfinite(self._newest), step**2 - self._power, 0.0)

    @property
    def image(self) -> NDArray[np.float64]:
        """How far each channel is from its resting value, (n_channels,)."""
        return self._newest - self._resting

    @property
    def least_range(self) -> float:
        """Smallest value that has the full colour, in the unit of the channels; 0 while no noise was measured."""
        return LEAST_NOISES * float(np.sqrt(self._power.max(initial=0.0)))


def places_of(channels: tuple[str, ...]) -> list[tuple[int, int]]:
    """Return row and column of each channel: from its name, else line by line in a square."""
    named = [PLACE.fullmatch(channel) for channel in channels]
    if named and all(named):
        return [(int(match[1]), int(match[2])) for match in named if match]
    columns = int(np.ceil(np.sqrt(len(channels)))) or 1
    return [divmod(number, columns) for number in range(len(channels))]


# --------------------
# Estimates as texts for people.

SEPARATOR, UNKNOWN = ' · ', '–'
REASONS = {Rejection.NOVEL: 'it resembles no trained texture', Rejection.OUTSIDE_TRAINING: 'outside the training'}


def in_words(value: IntEnum) -> str:
    """Return the name of a code as text: 'too little training'."""
    return value.name.lower().replace('_', ' ')


def texture_text(estimate: TextureEstimate) -> str:
    """Return a texture estimate as text, of a rejected one with the reason, once, and what the classifier notes."""
    if not estimate.label and not estimate.windows:
        return estimate.message or 'none yet'
    nearest = f'{estimate.label or "several"}, confidence {estimate.confidence:.2f} after {estimate.evidence_s:.1f} s'
    if estimate.accepted:
        return nearest
    reason, note = REASONS.get(estimate.rejection, in_words(estimate.rejection)), estimate.message
    why = note if reason in note else '; '.join(filter(None, (reason, note)))
    return f'unknown (nearest: {nearest}): {why}'


def evidence_text(estimate: TextureEstimate) -> str:
    """Return what a label rests on, and why it is rejected; without a label the message."""
    seen = f'{estimate.windows} windows, {estimate.evidence_s:.1f} s' if estimate.windows else ''
    if not estimate.label:
        return SEPARATOR.join(filter(None, (seen, estimate.message)))
    rejected = '' if estimate.accepted else f'rejected: {in_words(estimate.rejection)}'
    return SEPARATOR.join(filter(None, (f'confidence {quantity(estimate.confidence, 2)}', seen, rejected)))


def quantity(value: float, digits: int, unit: str = '') -> str:
    """Return a number as text, '–' if it is unknown."""
    return f'{value:.{digits}f} {unit}'.rstrip() if math.isfinite(value) else UNKNOWN


def number_text(name: str, unit: str, low: float, high: float) -> str:
    """Return a number of a motion with its range: 'speed (m/s), 0.002 to 0.25'."""
    what = f'{name.partition("_")[0]} ({unit})' if unit not in ('', name) else name
    return f'{what}, {low:g} to {high:g}{" within the workspace" * (unit == "m")}'


def roughness_text(estimate: RoughnessEstimate) -> str:
    """Return a roughness estimate as text."""
    if not estimate.valid:
        return estimate.message
    return f'{estimate.grade:.1f} ± {estimate.grade_std:.1f} on the scale from 1 (smooth) to 5 (rough)'


# --------------------
# What the page shows: the newest messages, in bounded memory, as one JSON text per frame.

FRAME_PERIOD_S = 0.1
MAX_EXPLORATIONS = 12  # that are listed; the page keeps the frames that it has shown of them, for replay
SIGNAL_S, SPECTRUM_S, LEVEL_S = 2.0, 0.5, 0.1
POINTS, BINS = 240, 128
MAX_LABELS = 200
DIGITS = 4


class Feed:
    """Collect the messages of the nodes and return frames. Used from one thread at a time."""

    def __init__(self) -> None:
        self._past: dict[str, dict[str, str]] = {}  # summaries by exploration, the newest last
        self.node_statuses = NodeStatuses()
        self._ring = Ring(SIGNAL_S)
        self._taxels = Taxels()
        self._state = ExplorationState(0, '', '', Phase.IDLE)
        self._texture = TextureEstimate(0, '')
        self._model = ModelInfo(0)
        self._roughness = RoughnessEstimate(0, '')
        self._began_s = math.inf  # the first frame
        self._may_press = False  # since an exploration that was not seen to end with a lifted finger
        self.recorded = False  # the messages come from a bag, in which no node can report
        self.recording = ''  # folder that is being recorded to
        self.fault = ''  # with which the last recording ended
        self.working = ''  # last message of a sub-command that the page has started

    @property
    def topics(self) -> Mapping[str, tuple[str, Callable[[Any], None]]]:
        """The type of each topic that is shown, and what takes its values."""
        return {
            'signal': ('TactileSignal', self.on_signal),
            'signal_static': ('TactileSignal', self.on_static),
            'exploration': ('ExplorationState', self.on_state),
            'texture': ('TextureEstimate', self.on_texture),
            'roughness': ('RoughnessEstimate', self.on_roughness),
            'model_info': ('ModelInfo', self.on_model),
        }

    def on_signal(self, signal: TactileSignal) -> None:
        """Take a batch of the fast stream."""
        self._ring.update(signal)

    def on_static(self, signal: TactileSignal) -> None:
        """Take a batch of the slow stream."""
        self._taxels.update(signal, touching=self._state.phase not in ENDED)

    def on_state(self, state: ExplorationState) -> None:
        """Take the state of the finger; a new exploration begins without evidence."""
        name = state.exploration_id
        if name and name not in self._past:
            self._texture, self._roughness = (
                TextureEstimate(state.stamp_ns, name),
                RoughnessEstimate(state.stamp_ns, name),
            )
            self._past[name] = {'motion': '', 'phase': '', 'label': 'no label', 'surface': '', 'grade': '', 'id': name}
            if len(self._past) > MAX_EXPLORATIONS:
                del self._past[next(iter(self._past))]
        self._state = state
        # An explorer that takes control again knows nothing of its finger; the last exploration has told of it.
        self._may_press = not state.lifted and (bool(name) or self._may_press)
        over = f'(over {state.surface})' if state.surface else ''
        self._note(name, {'motion': state.motion, 'phase': state.phase.value, 'surface': over})

    def on_texture(self, estimate: TextureEstimate) -> None:
        """Take an estimate; one of an exploration before the present one only enters its summary."""
        rejected = '' if estimate.accepted else f'?, rejected: {in_words(estimate.rejection)}'
        label = f'{estimate.label}{rejected}' if estimate.label else 'no label'
        self._note(estimate.exploration_id, {'label': label})
        if estimate.exploration_id == self._texture.exploration_id or not self._texture.exploration_id:
            self._texture = estimate

    def on_model(self, model: ModelInfo) -> None:
        """Take the labels of the classifier's model."""
        self._model = model

    def on_roughness(self, estimate: RoughnessEstimate) -> None:
        """Take an estimate; one of an exploration before the present one only enters its summary."""
        grade = f'roughness {estimate.grade:.1f}' if math.isfinite(estimate.grade) else ''
        self._note(estimate.exploration_id, {'grade': grade})
        if estimate.exploration_id == self._roughness.exploration_id or not self._roughness.exploration_id:
            self._roughness = estimate

    def _note(self, exploration_id: str, seen: Mapping[str, str]) -> None:
        """Add to the summary of an exploration that is listed."""
        if exploration_id in self._past:
            self._past[exploration_id].update(seen)

    def newest(self) -> tuple[ExplorationState, TextureEstimate, RoughnessEstimate]:
        """Return the newest state and estimates of the present exploration."""
        return self._state, self._texture, self._roughness

    @property
    def senses(self) -> bool:
        """Whether samples have come."""
        return self._ring.last is not None

    def frame(self, time_s: float) -> dict[str, Any]:
        """Return everything that is shown at a time of the monotonic clock, s, as JSON can carry it."""
        self._began_s = min(self._began_s, time_s)
        state, grade = self._state, self._roughness
        return {
            'warning': MAY_PRESS * (self._may_press and state.phase is Phase.IDLE),  # an explorer that was killed
            'fault': self.fault,
            'signal': self._signal(),
            'spectrum': {
                'db': _numbers(spectrum_db(self._ring.newest(SPECTRUM_S), BINS)),
                'high_hz': self._ring.last.sampling_rate_hz / 2 if self._ring.last else 0.0,
            },
            'taxels': self._image(),
            'state': {
                **_shown(state),
                'speed': quantity(state.speed_m_s, 3, 'm/s'),
                'force': quantity(state.force_n, 2, 'N'),
            },
            'texture': self._evidence(time_s),
            'roughness': {
                **_shown(grade),
                'shown': quantity(grade.grade, 1) if grade.valid else UNKNOWN,
                'note': f'± {quantity(grade.grade_std, 1)}' if grade.valid else grade.message,
                'text': roughness_text(grade),
            },
            'lights': self.node_statuses.shown(time_s),
            'past': [
                {'id': name, 'text': SEPARATOR.join(filter(None, seen.values()))}
                for name, seen in reversed(self._past.items())
            ],
            'recording': self.recording,
            'working': self.working,
        }

    def _signal(self) -> dict[str, Any]:
        last = self._ring.last
        names = (last.sensor, last.channels[0], last.common_unit) if last else ('', '', '')
        low, high = envelope(self._ring.newest(SIGNAL_S), POINTS)
        return {
            **dict(zip(('sensor', 'channel', 'unit'), names, strict=True)),
            'level': _number(float(np.std(self._ring.newest(LEVEL_S)))) if last else None,
            'low': _numbers(low),
            'high': _numbers(high),
            'length_s': SIGNAL_S,
        }

    def _image(self) -> dict[str, Any]:
        taxels = self._taxels
        least = {'least_range': _number(taxels.least_range)}
        return {'values': _numbers(taxels.image), 'places': taxels.places, 'unit': taxels.unit, **least}

    def _missing(self, time_s: float) -> str:
        """Return that there is no estimate yet, with the status of the classifier if that is not OK.

        Nodes report once a second: that none does is known after some of them.
        """
        if self.recorded:
            return 'no estimate'
        level, message = self.node_statuses.newest('classifier') or ('', '')
        if not level and time_s - self._began_s > SILENT_S:
            return 'no estimate yet, and no classifier reports on /diagnostics'
        return 'no estimate yet' + (f': {message}' if level not in ('', 'OK') else '')

    def _evidence(self, time_s: float) -> dict[str, Any]:
        """Return the estimate with the most probable labels first."""
        estimate, model = self._texture, self._model
        fits = (estimate.model, estimate.revision) == (model.model, model.revision)  # else the labels come in a moment
        labels = model.labels if fits else ()
        pairs = sorted(zip(estimate.probabilities, labels, strict=False), reverse=True)[:MAX_LABELS]
        missing = '' if estimate.label or estimate.message else self._missing(time_s)
        return {
            **_shown(estimate),
            'accepted': estimate.accepted,
            'shown': f'{estimate.label}{"?" * (not estimate.accepted)}' if estimate.label else UNKNOWN,
            'note': missing or evidence_text(estimate),
            'text': missing or texture_text(estimate),
            'labels': [label for _, label in pairs],
            'probabilities': _numbers(probability for probability, _ in pairs),
        }


def _shown(values: Any) -> dict[str, Any]:
    """Return the fields of a dataclass as JSON can carry them."""
    return {name: _plain(value) for name, value in asdict(values).items()}


def _plain(value: Any) -> Any:
    """Return a value as JSON can carry it exactly: NaN as null, nanoseconds as text."""
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, Phase):
        return value.value
    if isinstance(value, Rejection):
        return in_words(value)
    return str(value) if isinstance(value, int) and abs(value) > 2**53 else value


def _number(value: float) -> float | None:
    return float(f'{value:.{DIGITS}g}') if math.isfinite(value) else None


def _numbers(values: Iterable[float] | np.ndarray[Any, np.dtype[np.float64]]) -> list[float | None]:
    return [_number(float(value)) for value in values]
