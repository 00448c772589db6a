"""One light per node: green, yellow or red; a node that has fallen silent is red, one that has ended is grey."""

from __future__ import annotations

from dataclasses import dataclass

SILENT_S = 5.0  # nodes report once a second
MAX_LIGHTS = 64
MAX_CHARACTERS = 300
ENDED_COLOURS = {'OK': 'grey', 'WARN': 'yellow', 'ERROR': 'red'}
COLOURS = {'OK': 'green', 'WARN': 'yellow', 'ERROR': 'red'}


@dataclass(frozen=True)
class NodeStatus:
    """What a node said last, when (monotonic clock, s), and whether it ended with that."""

    level: str
    message: str
    time_s: float
    ended: bool = False


class NodeStatuses:
    """Keep what each node said last."""

    def __init__(self) -> None:
        self._lights: dict[str, NodeStatus] = {}

    def update(self, name: str, level: str, message: str, time_s: float, ended: bool = False) -> None:
        """Take note of a report; when there are too many names, the one silent for longest is forgotten.

        Parameters
        ----------
        name
            Name of the status.
        level
            'OK', 'WARN', 'ERROR' or 'STALE'.
        message
            One sentence.
        time_s
            When it came, of a clock that only rises.
        ended
            Whether the node has ended.
        """
        self._lights.pop(name, None)
        self._lights[name[:MAX_CHARACTERS]] = NodeStatus(level, message[:MAX_CHARACTERS], time_s, ended)
        if len(self._lights) > MAX_LIGHTS:
            del self._lights[next(iter(self._lights))]

    def newest(self, name: str) -> NodeStatus | None:
        """Return what a node said last; None if it never did."""
        return self._lights.get(name)

    def shown(self, time_s: float) -> list[dict[str, str]]:
        """Return name, colour and sentence of each light, by name."""
        return [{'name': name, **_look(light, time_s - light.time_s)} for name, light in sorted(self._lights.items())]


def _look(light: NodeStatus, age_s: float) -> dict[str, str]:
    if light.ended:
        return {'colour': ENDED_COLOURS.get(light.level, 'red'), 'message': f'ended: {light.message}'}
    if age_s > SILENT_S:
        return {'colour': 'red', 'message': f'silent for {age_s:.0f} s; it said last: {light.message}'}
    return {'colour': COLOURS.get(light.level, 'red'), 'message': light.message}
