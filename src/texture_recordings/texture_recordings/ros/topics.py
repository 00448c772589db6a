"""Type and quality of service of each topic of the suite, by the last part of its name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile
from texture_msgs import msg

from texture_core.ros.qos import ESTIMATE_QOS, FEATURE_QOS, SENSOR_QOS, STATE_QOS


class Topic(NamedTuple):
    """What is needed to publish or subscribe."""

    type: Any
    qos: QoSProfile
    name: str  # relative to the node's namespace, unless it begins with '/'

    @property
    def msgtype(self) -> str:
        """Name of the type as bags write it, 'texture_msgs/msg/TactileSignal'."""
        return f'{self.type.__module__.split(".")[0]}/msg/{self.type.__name__}'


TOPICS: Mapping[str, Topic] = {
    'signal': Topic(msg.TactileSignal, SENSOR_QOS, 'signal'),
    'signal_static': Topic(msg.TactileSignal, SENSOR_QOS, 'signal_static'),
    'exploration': Topic(msg.ExplorationState, STATE_QOS, 'exploration'),
    'features': Topic(msg.FeatureVector, FEATURE_QOS, 'features'),
    'texture': Topic(msg.TextureEstimate, ESTIMATE_QOS, 'texture'),
    'roughness': Topic(msg.RoughnessEstimate, ESTIMATE_QOS, 'roughness'),
    'diagnostics': Topic(DiagnosticArray, QoSProfile(depth=100), '/diagnostics'),
}
