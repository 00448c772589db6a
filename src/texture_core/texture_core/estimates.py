"""Estimates of texture and roughness."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class TextureEstimate:
    """Which surface is being touched; label '' and no probabilities while there is no evidence.

    A label of '' with probabilities: the evidence speaks for several surfaces alike, it is unclassified.
    """

    stamp_ns: int
    exploration_id: str
    label: str = ''
    known: bool = False
    confidence: float = math.nan
    labels: tuple[str, ...] = ()
    probabilities: tuple[float, ...] = ()
    decided: bool = False
    prediction_set: tuple[str, ...] = ()
    windows: int = 0
    evidence_s: float = 0.0
    final: bool = False
    processing_s: float = 0.0
    model: str = ''
    message: str = ''
    frame_id: str = ''


@dataclass(frozen=True)
class RoughnessEstimate:
    """How rough the surface is, 1 (smooth) to 5 (rough); not valid while there is no grade."""

    stamp_ns: int
    exploration_id: str
    valid: bool = False
    grade: float = math.nan
    grade_std: float = math.nan
    windows: int = 0
    evidence_s: float = 0.0
    final: bool = False
    processing_s: float = 0.0
    model: str = ''
    message: str = ''
    frame_id: str = ''
