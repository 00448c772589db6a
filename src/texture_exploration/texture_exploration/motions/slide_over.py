"""The stages that every slide of a finger over a surface has, whatever its path."""

from __future__ import annotations

from texture_core.exploration import ExplorationRequest
from texture_exploration.arms.protocol import Vector
from texture_exploration.motions.path import Follower
from texture_exploration.motions.staged_motion import StagedMotion
from texture_exploration.motions.stages import Accelerate, Approach, Brake, GoHome, Lift, Settle, Slide
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits


def slide_over(
    follower: Follower, request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits
) -> StagedMotion:
    """Return the motion along a path, for a request whose speed and force are filled in and checked."""
    speed, force = request.speed_m_s, request.force_n
    slide = Slide(follower, speed, force, limits)
    stages = [
        GoHome(home, touch, limits),
        Approach(force, touch, limits),
        Settle(force, touch, limits),
        Accelerate(follower, speed, force, touch, limits),
        slide,
        Brake(follower, speed, force, touch, limits),
        Lift(home, touch, limits),
    ]
    return StagedMotion(stages, slide)
