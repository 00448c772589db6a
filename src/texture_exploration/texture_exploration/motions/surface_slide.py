"""The stages that every slide of a finger over a surface has, whatever its path."""

from __future__ import annotations

from texture_core.exploration import ExplorationRequest
from texture_exploration.arms.protocol import Vector
from texture_exploration.motions.contact import ContactWatch
from texture_exploration.motions.path import Follower
from texture_exploration.motions.staged_motion import StagedMotion
from texture_exploration.motions.stages import (
    AccelerateStage,
    ApproachStage,
    BrakeStage,
    GoHomeStage,
    Halt,
    LiftStage,
    SettleForceStage,
    SlideStage,
    Stage,
)
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits


def plan_surface_slide(
    follower: Follower, request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits
) -> StagedMotion:
    """Return the motion along a path, for a request whose speed and force are filled in and checked.

    Parameters
    ----------
    follower
        Path along the surface, as a function of the travelled distance.
    request
        With speed and force filled in and checked.
    home
        Place above which the finger comes down, m, in the frame of the surface.
    touch
        How the finger approaches, presses and lifts.
    limits
        Allowed speeds, forces and workspace.

    Returns
    -------
    StagedMotion
        Go there, touch, press, speed up, slide, brake and lift.
    """
    speed, force = request.speed_m_s, request.force_n
    contact = ContactWatch(force, touch)
    slide = SlideStage(follower, speed, force, touch, limits, contact=contact)

    def come_down() -> list[Stage]:
        return [
            ApproachStage(force, touch, limits),
            SettleForceStage(force, touch, limits),
            AccelerateStage(follower, speed, force, touch, limits, contact=contact),
        ]

    def seek() -> list[Stage]:
        return [Halt(follower, speed, touch, limits), *come_down()]

    stages = [
        GoHomeStage(home, touch, limits),
        *come_down(),
        slide,
        BrakeStage(follower, speed, force, touch, limits, contact=contact),
        LiftStage(home, force, touch, limits),
    ]
    return StagedMotion(stages, slide, seek if touch.seek_lost_contact else None)
