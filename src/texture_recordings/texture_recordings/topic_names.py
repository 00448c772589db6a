"""The names of the topics of a sensor in a bag."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rosbags.interfaces import Connection

from texture_core.errors import InvalidData
from texture_recordings.cdr import MESSAGES, typestore

EXPLORATION = 'exploration'


def short_name(topic: str) -> str:
    """Return the last part of a topic's name: 'signal' of '/left/signal'."""
    return topic.rsplit('/', 1)[-1]


def connections_below(path: Path, connections: list[Connection], namespace: str | None) -> list[Connection]:
    """Return the connections of the suite's messages in a namespace, and those of the diagnostics.

    Parameters
    ----------
    path
        The bag, for messages.
    connections
        All connections of the bag.
    namespace
        Namespace of the sensor; None if there is only one.

    Returns
    -------
    list of Connection

    Raises
    ------
    InvalidData
        If the bag has other messages, other definitions of them, several namespaces or not this one.
    """
    ours = [c for c in connections if c.msgtype in MESSAGES]
    if not ours:
        named = ', '.join(sorted({c.msgtype for c in connections})) or 'nothing'
        raise InvalidData(
            f"the bag '{path}' holds {named}; messages of texture_msgs are needed, record the suite's topics"
        )
    for connection in ours:
        if connection.digest and connection.digest != typestore().hash_rihs01(connection.msgtype):
            raise InvalidData(
                f"the bag '{path}' was recorded with another definition of {connection.msgtype}; record it again"
            )
    names = topic_names(c.topic for c in ours)
    namespaces = {topic: topic.removesuffix(name).rstrip('/') or '/' for topic, name in names.items()}
    found = sorted(set(namespaces.values()))
    if namespace is None and len(found) > 1:
        raise InvalidData(f"the bag '{path}' has the namespaces {', '.join(found)}; name one of them")
    prefix = found[0] if namespace is None else '/' + namespace.strip('/')
    if prefix not in found:
        raise InvalidData(f"the bag '{path}' has no namespace '{prefix}'; it has {', '.join(found)}")
    common = [c for c in connections if c.topic == '/diagnostics']
    return [c for c in ours if namespaces[c.topic] == prefix] + common


def topic_names(topics: Iterable[str]) -> dict[str, str]:
    """Return the name of each topic below its namespace, which is the folder of its explorer.

    Several fingers of one explorer stream on 'finger0/signal' and so on; a topic without an explorer above it belongs
    to the folder in which it is.

    Examples
    --------
    >>> topic_names(['/left/exploration', '/left/finger0/signal', '/right/signal'])
    {'/left/exploration': 'exploration', '/left/finger0/signal': 'finger0/signal', '/right/signal': 'signal'}
    """
    given = list(topics)
    explorers = {_folder(topic) for topic in given if short_name(topic) == EXPLORATION}
    names = {}
    for topic in given:
        folder = _folder(topic)
        while folder and folder not in explorers:
            folder = _folder(folder)
        names[topic] = topic.removeprefix(f'{folder}/') if folder in explorers else short_name(topic)
    return names


def _folder(topic: str) -> str:
    return topic.rpartition('/')[0]
