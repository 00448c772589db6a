"""See that nobody else publishes what a replay publishes: two streams on one topic would be mixed in every window."""

from __future__ import annotations

from collections.abc import Iterable

from rclpy.node import Node
from rclpy.publisher import Publisher

from texture_core.errors import InvalidData


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
            f'launch replay bag:={bag}`, or play the bag beside it by `texture launch replay bag:={bag} '
            'namespace:=replay`'
        )
