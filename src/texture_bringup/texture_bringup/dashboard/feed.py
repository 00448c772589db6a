"""What the page shows: the newest of everything, in bounded memory, as one JSON text a frame."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

import numpy as np

from texture_bringup.dashboard.history import History
from texture_bringup.dashboard.node_status import NodeStatuses
from texture_bringup.dashboard.ring import Ring, envelope, spectrum_db
from texture_bringup.dashboard.taxels import Taxels
from texture_core.estimates import RoughnessEstimate, TextureEstimate
from texture_core.exploration import ENDED, ExplorationState, Phase
from texture_core.signal import TactileSignal

FRAME_PERIOD_S = 0.1
SIGNAL_S, SPECTRUM_S = 2.0, 0.5
POINTS, BINS = 240, 128
MAX_LABELS = 200
DIGITS = 4
IDLE = ExplorationState(0, '', '', Phase.IDLE)


class Feed:
    """Take what the nodes publish; give frames. Used from one thread at a time."""

    def __init__(self) -> None:
        self.history = History()
        self.node_statuses = NodeStatuses()
        self._ring = Ring(SIGNAL_S)
        self._taxels = Taxels()
        self._state = IDLE
        self._texture = TextureEstimate(0, '')
        self._roughness = RoughnessEstimate(0, '')
        self.recording = ''  # folder that is being recorded to

    def on_signal(self, signal: TactileSignal) -> None:
        """Take a batch of the fast stream."""
        self._ring.update(signal)

    def on_static(self, signal: TactileSignal) -> None:
        """Take a batch of the slow stream."""
        self._taxels.update(signal, touching=self._state.phase not in ENDED)

    def on_state(self, state: ExplorationState) -> None:
        """Take what the finger is doing; a new exploration begins without evidence."""
        if state.exploration_id and state.exploration_id not in self.history:
            self._texture = TextureEstimate(state.stamp_ns, state.exploration_id)
            self._roughness = RoughnessEstimate(state.stamp_ns, state.exploration_id)
        self._state = state
        if state.exploration_id:
            seen = {'motion': state.motion, 'phase': state.phase.value, 'surface': state.surface}
            self.history.add(state.exploration_id, {'stamp_ns': str(state.stamp_ns), **seen})

    def on_texture(self, estimate: TextureEstimate) -> None:
        """Take an estimate; one of an exploration before the present one only enters its summary."""
        reported = {'label': estimate.label, 'confidence': _number(estimate.confidence), 'known': estimate.known}
        if estimate.exploration_id in self.history:
            self.history.add(estimate.exploration_id, reported)
        if estimate.exploration_id == self._texture.exploration_id or not self._texture.exploration_id:
            self._texture = estimate

    def on_roughness(self, estimate: RoughnessEstimate) -> None:
        """Take an estimate; one of an exploration before the present one only enters its summary."""
        if estimate.exploration_id in self.history:
            self.history.add(estimate.exploration_id, {'grade': _number(estimate.grade)})
        if estimate.exploration_id == self._roughness.exploration_id or not self._roughness.exploration_id:
            self._roughness = estimate

    @property
    def exploring(self) -> bool:
        """Whether an exploration is going on, whose frames are kept."""
        return bool(self._state.exploration_id) and self._state.phase not in ENDED

    def frame(self, time_s: float) -> str:
        """Return everything the page shows at a time of the monotonic clock, s, and keep it for replay."""
        frame = {
            'signal': self._signal(),
            'spectrum': self._spectrum(),
            'taxels': self._image(),
            'state': self._shown_state(),
            'texture': self._evidence(),
            'roughness': {name: _plain(value) for name, value in asdict(self._roughness).items()},
        }
        text = json.dumps(frame, allow_nan=False)
        if self.exploring:
            self.history.add(self._state.exploration_id, {}, text)
        rest = {'lights': self.node_statuses.shown(time_s), 'past': self.history.listed(), 'recording': self.recording}
        return f'{text[:-1]}, {json.dumps(rest)[1:]}'

    def _signal(self) -> dict[str, Any]:
        ring = self._ring
        low, high = envelope(ring.newest(SIGNAL_S), POINTS)
        names = {'sensor': ring.sensor, 'channel': ring.channel, 'unit': ring.unit}
        return {**names, 'low': _numbers(low), 'high': _numbers(high), 'length_s': SIGNAL_S, 'lost': ring.lost}

    def _spectrum(self) -> dict[str, Any]:
        levels = spectrum_db(self._ring.newest(SPECTRUM_S), BINS)
        return {'db': _numbers(levels), 'high_hz': self._ring.rate_hz / 2}

    def _image(self) -> dict[str, Any]:
        taxels = self._taxels
        least = {'least_range': _number(taxels.least_range)}
        return {'values': _numbers(taxels.image), 'places': taxels.places, 'unit': taxels.unit, **least}

    def _missing(self, what: str, name: str) -> str:
        """Return that there is no estimate yet and what its node says, if that node is not well."""
        status = self.node_statuses.newest(name)
        if status is None:
            return f'no {what} yet, and no {name} reports on /diagnostics'
        return f'no {what} yet' + ('' if status.level == 'OK' else f': {status.message}')

    def _shown_state(self) -> dict[str, Any]:
        return {name: _plain(value) for name, value in asdict(self._state).items()}

    def _evidence(self) -> dict[str, Any]:
        """Return the estimate with the most probable labels first."""
        estimate = self._texture
        pairs = sorted(zip(estimate.probabilities, estimate.labels, strict=False), reverse=True)[:MAX_LABELS]
        shown = {name: _plain(value) for name, value in asdict(estimate).items()}
        shown['missing'] = '' if estimate.label or estimate.message else self._missing('estimate', 'classifier')
        shown['labels'] = [label for _, label in pairs]
        shown['probabilities'] = _numbers(probability for probability, _ in pairs)
        return shown


def _plain(value: Any) -> Any:
    """Return a value as JSON can carry it exactly: NaN as null, nanoseconds as text."""
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, Phase):
        return value.value
    return str(value) if isinstance(value, int) and abs(value) > 2**53 else value


def _number(value: float) -> float | None:
    return float(f'{value:.{DIGITS}g}') if math.isfinite(value) else None


def _numbers(values: Iterable[float] | np.ndarray[Any, np.dtype[np.float64]]) -> list[float | None]:
    return [_number(float(value)) for value in values]
