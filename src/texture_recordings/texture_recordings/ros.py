# SPDX-License-Identifier: Apache-2.0
"""Topics to record, and the check that nobody else publishes them."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from texture_msgs import msg

from texture_core.errors import InvalidData
from texture_core.ros import ESTIMATE_QOS, FEATURE_QOS, SENSOR_QOS, STATE_QOS, quality_of_service

# --------------------
# See that nobody else publishes what a replay publishes: two streams on one topic would be mixed in every window.


def refuse_other_publishers(node: Node, outputs: Iterable[Publisher], bag: str) -> None:
    """Refuse to replay where another node publishes on one of the topics.

    Parameters
    ----------
    node
        Node that has the publishers.
    outputs
        The publishers of the replay.
    bag
        Path of the bag, for the sentence.

    Raises
    ------
    InvalidData
        If a topic has another publisher.
    """
    taken = [output.topic_name for output in outputs if node.count_publishers(output.topic_name) > 1]
    if taken:
        raise InvalidData(
            f"another node publishes '{taken[0]}', and the samples of both would be mixed; stop it and start `texture "
            f'launch replay bag:={bag}`, or play the bag next to it with `texture launch replay bag:={bag} '
            'namespace:=replay`'
        )


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
    """Return the class of a type of messages, such as 'tf2_msgs/msg/TFMessage'.

    Raises
    ------
    InvalidData
        If its package is not installed.
    """
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
