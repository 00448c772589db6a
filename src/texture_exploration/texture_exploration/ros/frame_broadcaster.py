"""Frames of surface and fingertip on tf, where tf2_msgs is installed."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import TransformStamped
from rclpy.qos import DurabilityPolicy, QoSProfile

from texture_core.errors import InvalidParameter
from texture_core.exploration import ExplorationState
from texture_core.parameters import param
from texture_core.ros.frames import frame_name
from texture_core.ros.time import to_stamp
from texture_core.rotation import quaternion

STATIC_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
MOVING_QOS = QoSProfile(depth=100)


@dataclass(frozen=True)
class FrameParams:
    """Parameters of the frames in published messages."""

    surface_frame_id: str = param(
        'surface',
        'Sets the frame of the surface in the headers of the published states; in a namespace NAMESPACE/ is put before '
        'it.',
    )
    fingertip_frame_id: str = param(
        'fingertip', 'Sets the frame of the fingertip that is broadcast; in a namespace NAMESPACE/ is put before it.'
    )
    broadcast_surface: bool = param(
        True, 'Broadcasts the surface in the base frame of the arm on /tf_static, if tf2_msgs is installed.'
    )
    broadcast_fingertip: bool = param(
        False,
        'Broadcasts where the fingertip is in the frame of the surface on /tf while it explores; leave it off if the '
        'description of the robot holds the fingertip.',
    )


class FrameBroadcaster:
    """Publish transforms of one arm.

    Parameters
    ----------
    node
        Owner of the publishers.
    params
        Names of the frames, and which are broadcast.

    Attributes
    ----------
    surface_frame_id : str
        Full name of the frame of the surface.

    Raises
    ------
    InvalidParameter
        If the fingertip is to be broadcast and tf2_msgs is not installed.
    """

    def __init__(self, node: Any, params: FrameParams) -> None:
        self._node = node
        self.surface_frame_id = frame_name(node.get_namespace(), params.surface_frame_id)
        self._fingertip_frame_id = frame_name(node.get_namespace(), params.fingertip_frame_id)
        self._static = self._moving = None
        try:
            self._kind = importlib.import_module('tf2_msgs.msg').TFMessage
        except ImportError as error:
            if params.broadcast_fingertip:
                raise InvalidParameter(
                    "parameter 'broadcast_fingertip' is true, which needs tf2_msgs; install it (ros-jazzy-tf2-msgs)"
                ) from error
            return
        if params.broadcast_surface:
            self._static = node.create_publisher(self._kind, '/tf_static', STATIC_QOS)
        if params.broadcast_fingertip:
            self._moving = node.create_publisher(self._kind, '/tf', MOVING_QOS)

    def surface(self, base_frame_id: str, pose: Sequence[float]) -> None:
        """Broadcast the pose of the surface in the base frame: place in m, then a rotation vector in rad, (6,)."""
        if self._static is None:
            return
        transform = self._transform(base_frame_id, self.surface_frame_id, pose[:3])
        transform.header.stamp = self._node.get_clock().now().to_msg()
        turned = transform.transform.rotation
        turned.x, turned.y, turned.z, turned.w = quaternion(pose[3:])
        self._static.publish(self._kind(transforms=[transform]))

    def fingertip(self, state: ExplorationState) -> None:
        """Broadcast where the finger is, with the axes of the surface; a state without a place is passed over."""
        if self._moving is None or state.x_m != state.x_m:
            return
        place = (state.x_m, state.y_m, state.z_m)
        transform = self._transform(self.surface_frame_id, self._fingertip_frame_id, place)
        transform.header.stamp = to_stamp(state.stamp_ns)
        self._moving.publish(self._kind(transforms=[transform]))

    @staticmethod
    def _transform(parent: str, child: str, place_m: Sequence[float]) -> TransformStamped:
        transform = TransformStamped(child_frame_id=child)
        transform.header.frame_id = parent
        shift = transform.transform.translation
        shift.x, shift.y, shift.z = map(float, place_m)
        return transform
