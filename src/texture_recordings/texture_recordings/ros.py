# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Topics of the suite that are recorded and replayed."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile
from texture_msgs import msg

from texture_core.errors import InvalidData
from texture_core.ros import ESTIMATE_QOS, FEATURE_QOS, SENSOR_QOS, STATE_QOS, quality_of_service

# --------------------
# Type and quality of service of each topic of the suite, by the last part of its name.


class Topic(NamedTuple):
    """What is needed to publish or subscribe."""

    type: Any
    qos: QoSProfile
    name: str  # relative to the node's namespace, unless it begins with '/'

    @property
    def msgtype(self) -> str:
        """Name of the type as bags write it, 'texture_msgs/msg/TactileSignal'."""
        return f'{self.type.__module__.split(".")[0]}/msg/{self.type.__name__}'


def message_class(msgtype: str) -> Any:
    """Return the class of a type of messages, such as 'tf2_msgs/msg/TFMessage'."""
    package, _, name = msgtype.split('/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError) as error:
        raise InvalidData(
            f"messages of the type '{msgtype}' are not installed; install the package {package}"
        ) from error


TOPICS: Mapping[str, Topic] = {
    'signal': Topic(msg.TactileSignal, SENSOR_QOS, 'signal'),
    'signal_static': Topic(msg.TactileSignal, SENSOR_QOS, 'signal_static'),
    'exploration': Topic(msg.ExplorationState, STATE_QOS, 'exploration'),
    'features': Topic(msg.FeatureVector, FEATURE_QOS, 'features'),
    'texture': Topic(msg.TextureEstimate, ESTIMATE_QOS, 'texture'),
    'roughness': Topic(msg.RoughnessEstimate, ESTIMATE_QOS, 'roughness'),
    'model_info': Topic(msg.ModelInfo, quality_of_service('model_info'), 'model_info'),
    'diagnostics': Topic(DiagnosticArray, QoSProfile(depth=100), '/diagnostics'),
}
