"""Past explorations, each with the frames that were shown during it, for replay."""

from __future__ import annotations

import zlib
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any

MAX_EXPLORATIONS = 12
MAX_FRAMES = 300  # of one exploration; a longer one is thinned to every second frame, again and again


@dataclass
class Past:
    """One exploration: its summary, and the texts of its frames, compressed: a page in memory for each is too much."""

    summary: dict[str, Any]
    frames: list[bytes] = field(default_factory=list)
    stride: int = 1
    seen: int = 0

    def add(self, frame: str) -> None:
        """Keep every `stride`-th frame."""
        if self.seen % self.stride == 0:
            self.frames.append(zlib.compress(frame.encode(), 1))
        self.seen += 1
        if len(self.frames) > MAX_FRAMES:
            self.frames, self.stride = self.frames[::2], self.stride * 2


class History:
    """Keep the newest explorations."""

    def __init__(self) -> None:
        self._past: OrderedDict[str, Past] = OrderedDict()

    def add(self, exploration_id: str, summary: dict[str, Any], frame: str = '') -> None:
        """Note what is now known of an exploration, and the frame shown now if it is going on.

        Parameters
        ----------
        exploration_id
            Id of the exploration.
        summary
            Plain values for the page.
        frame
            Frame of the page, as JSON; '' if it is over.
        """
        past = self._past.setdefault(exploration_id, Past({}))
        past.summary = {**past.summary, **summary, 'id': exploration_id}
        if frame:
            past.add(frame)
        while len(self._past) > MAX_EXPLORATIONS:
            self._past.popitem(last=False)

    def __contains__(self, exploration_id: str) -> bool:
        return exploration_id in self._past

    def listed(self) -> list[dict[str, Any]]:
        """Return the summaries, newest first."""
        return [past.summary for past in reversed(self._past.values())]

    def replay(self, exploration_id: str) -> str | None:
        """Return the frames of an exploration as a JSON list with the time between them; None if it is not kept."""
        past = self._past.get(exploration_id)
        if past is None:
            return None
        frames = ', '.join(zlib.decompress(frame).decode() for frame in past.frames)
        return f'{{"stride": {past.stride}, "frames": [{frames}]}}'
