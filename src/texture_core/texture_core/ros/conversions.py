"""Data classes of texture_core to messages and back; each pair is one row of two tables."""

from __future__ import annotations

import array
from typing import Any

import numpy as np
from std_msgs.msg import Header
from texture_msgs import msg
from texture_msgs.action import Explore

from texture_core.errors import InvalidData
from texture_core.estimates import RoughnessEstimate, TextureEstimate
from texture_core.exploration import ExplorationRequest, ExplorationState, Phase
from texture_core.features import FeatureVector
from texture_core.ros.time import to_ns, to_stamp
from texture_core.signal import TactileSignal


def to_msg(value: Any) -> Any:
    """Return the message of a data class of texture_core."""
    return TO_MSG[type(value)](value)


def from_msg(message: Any) -> Any:
    """Return the data class of a message of texture_msgs.

    Raises
    ------
    InvalidData
        If the message contradicts itself.
    """
    return FROM_MSG[type(message)](message)


def _signal_to_msg(signal: TactileSignal) -> msg.TactileSignal:
    message = msg.TactileSignal(
        header=Header(stamp=to_stamp(signal.stamp_ns), frame_id=signal.frame_id),
        sensor=signal.sensor,
        channels=list(signal.channels),
        unit=signal.unit,
        sampling_rate_hz=float(signal.sampling_rate_hz),
        first_sample=signal.first_sample,
    )
    # An array.array is taken as it is; a list would be checked element by element.
    message.samples = array.array('f', np.ascontiguousarray(signal.samples, dtype=np.float32).tobytes())
    return message


def _signal_from_msg(message: msg.TactileSignal) -> TactileSignal:
    channels = tuple(message.channels)
    flat = np.array(message.samples, dtype=np.float32)
    if not channels or len(flat) % len(channels):
        raise InvalidData(
            f"signal message of '{message.sensor}' has {len(flat)} samples for {len(channels)} channels; "
            'a multiple of the number of channels is needed'
        )
    return TactileSignal(
        stamp_ns=to_ns(message.header.stamp),
        sensor=message.sensor,
        channels=channels,
        unit=message.unit,
        sampling_rate_hz=message.sampling_rate_hz,
        first_sample=message.first_sample,
        samples=flat.reshape(-1, len(channels)),
        frame_id=message.header.frame_id,
    )


def _state_to_msg(state: ExplorationState) -> msg.ExplorationState:
    return msg.ExplorationState(
        header=Header(stamp=to_stamp(state.stamp_ns)),
        exploration_id=state.exploration_id,
        motion=state.motion,
        phase=state.phase.value,
        steady_s=float(state.steady_s),
        speed_m_s=float(state.speed_m_s),
        force_n=float(state.force_n),
        direction_rad=float(state.direction_rad),
        progress=float(state.progress),
        surface=state.surface,
    )


def _state_from_msg(message: msg.ExplorationState) -> ExplorationState:
    try:
        phase = Phase(message.phase)
    except ValueError as error:
        raise InvalidData(
            f"exploration state has the phase '{message.phase}'; allowed are {', '.join(p.value for p in Phase)}"
        ) from error
    return ExplorationState(
        stamp_ns=to_ns(message.header.stamp),
        exploration_id=message.exploration_id,
        motion=message.motion,
        phase=phase,
        steady_s=message.steady_s,
        speed_m_s=message.speed_m_s,
        force_n=message.force_n,
        direction_rad=message.direction_rad,
        progress=message.progress,
        surface=message.surface,
    )


def _features_to_msg(vector: FeatureVector) -> msg.FeatureVector:
    message = msg.FeatureVector(
        header=Header(stamp=to_stamp(vector.start_ns)),
        exploration_id=vector.exploration_id,
        window_s=float(vector.window_s),
        hop_s=float(vector.hop_s),
        speed_m_s=float(vector.speed_m_s),
        force_n=float(vector.force_n),
        names=list(vector.names),
        feature_set=vector.feature_set,
        last=vector.last,
        skipped=vector.skipped,
    )
    message.values = array.array('d', np.ascontiguousarray(vector.values, dtype=np.float64).tobytes())
    return message


def _features_from_msg(message: msg.FeatureVector) -> FeatureVector:
    return FeatureVector(
        start_ns=to_ns(message.header.stamp),
        exploration_id=message.exploration_id,
        window_s=message.window_s,
        hop_s=message.hop_s,
        names=tuple(message.names),
        values=np.array(message.values, dtype=np.float64),
        speed_m_s=message.speed_m_s,
        force_n=message.force_n,
        feature_set=message.feature_set,
        last=message.last,
        skipped=message.skipped,
    )


def _texture_to_msg(estimate: TextureEstimate) -> msg.TextureEstimate:
    message = msg.TextureEstimate(
        header=Header(stamp=to_stamp(estimate.stamp_ns)),
        exploration_id=estimate.exploration_id,
        label=estimate.label,
        known=estimate.known,
        confidence=float(estimate.confidence),
        labels=list(estimate.labels),
        certain=estimate.certain,
        candidates=list(estimate.candidates),
        windows=estimate.windows,
        evidence_s=float(estimate.evidence_s),
        final=estimate.final,
        processing_s=float(estimate.processing_s),
        model=estimate.model,
        message=estimate.message,
    )
    message.probabilities = array.array('d', estimate.probabilities)
    return message


def _texture_from_msg(message: msg.TextureEstimate) -> TextureEstimate:
    return TextureEstimate(
        stamp_ns=to_ns(message.header.stamp),
        exploration_id=message.exploration_id,
        label=message.label,
        known=message.known,
        confidence=message.confidence,
        labels=tuple(message.labels),
        probabilities=tuple(message.probabilities),
        certain=message.certain,
        candidates=tuple(message.candidates),
        windows=message.windows,
        evidence_s=message.evidence_s,
        final=message.final,
        processing_s=message.processing_s,
        model=message.model,
        message=message.message,
    )


def _roughness_to_msg(estimate: RoughnessEstimate) -> msg.RoughnessEstimate:
    return msg.RoughnessEstimate(
        header=Header(stamp=to_stamp(estimate.stamp_ns)),
        exploration_id=estimate.exploration_id,
        valid=estimate.valid,
        grade=float(estimate.grade),
        grade_std=float(estimate.grade_std),
        windows=estimate.windows,
        evidence_s=float(estimate.evidence_s),
        final=estimate.final,
        processing_s=float(estimate.processing_s),
        model=estimate.model,
        message=estimate.message,
    )


def _roughness_from_msg(message: msg.RoughnessEstimate) -> RoughnessEstimate:
    return RoughnessEstimate(
        stamp_ns=to_ns(message.header.stamp),
        exploration_id=message.exploration_id,
        valid=message.valid,
        grade=message.grade,
        grade_std=message.grade_std,
        windows=message.windows,
        evidence_s=message.evidence_s,
        final=message.final,
        processing_s=message.processing_s,
        model=message.model,
        message=message.message,
    )


def request_from_msg(goal: Any) -> ExplorationRequest:
    """Return the request in a goal of the action or a request of the service: both have the same fields."""
    return ExplorationRequest(**{name: getattr(goal, name) for name in ExplorationRequest.__dataclass_fields__})


def request_to_msg(request: ExplorationRequest, kind: Any = Explore.Goal) -> Any:
    """Return a goal of the action, or of another `kind` with the same fields."""
    return kind(**{name: getattr(request, name) for name in ExplorationRequest.__dataclass_fields__})


TO_MSG = {
    TactileSignal: _signal_to_msg,
    ExplorationState: _state_to_msg,
    FeatureVector: _features_to_msg,
    TextureEstimate: _texture_to_msg,
    RoughnessEstimate: _roughness_to_msg,
}
FROM_MSG = {
    msg.TactileSignal: _signal_from_msg,
    msg.ExplorationState: _state_from_msg,
    msg.FeatureVector: _features_from_msg,
    msg.TextureEstimate: _texture_from_msg,
    msg.RoughnessEstimate: _roughness_from_msg,
}
