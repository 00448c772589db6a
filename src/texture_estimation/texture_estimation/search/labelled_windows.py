"""Windows of labelled slides, not yet described: what an individual's features are computed from."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import InvalidData
from texture_core.window import Window
from texture_estimation.learners.learner import Codes
from texture_features.feature import WindowBatch
from texture_features.windowing.windows import CutWindow, WindowEvent, WindowParams


@dataclass(frozen=True, eq=False)
class LabelledWindows:
    """Windows of labelled slides, all of one rate and length in each input.

    Parameters
    ----------
    inputs
        Topic → windows with samples (n, n_samples, n_channels), speed and force.
    labels, groups : (n,) of text
        Surface and slide of each window.

    Examples
    --------
    >>> batch = WindowBatch(np.zeros((3, 50, 1)), 100.0, np.full(3, 0.05), np.ones(3))
    >>> labels, groups = np.array(['cork', 'felt', 'felt']), np.array(['a', 'b', 'b'])
    >>> windows = LabelledWindows({'signal': batch}, labels, groups)
    >>> some, chosen = windows.of(['felt'])
    >>> some.labels.tolist(), chosen.tolist()
    (['felt', 'felt'], [False, True, True])
    """

    inputs: Mapping[str, WindowBatch]
    labels: NDArray[np.str_]
    groups: NDArray[np.str_]

    @classmethod
    def from_events(cls, events: Iterable[WindowEvent], topics: Sequence[str]) -> LabelledWindows:
        """Stack the windows of labelled slides.

        Raises
        ------
        InvalidData
            If there is none, or they differ in rate, length or channels.
        """
        cut = [event for event in events if isinstance(event, CutWindow) and event.surface]
        if not cut:
            raise InvalidData('there is no window of a labelled surface; record slides with a surface named')
        speed = np.array([event.speed_m_s for event in cut])
        force = np.array([event.force_n for event in cut])
        inputs = {topic: _stacked([event.windows[topic] for event in cut], topic, speed, force) for topic in topics}
        labels = np.array([event.surface for event in cut])
        return cls(inputs, labels, np.array([event.exploration_id for event in cut]))

    def of(self, names: Sequence[str]) -> tuple[LabelledWindows, NDArray[np.bool_]]:
        """Return the examples of some surfaces alone, and which of all these are, (n,).

        Parameters
        ----------
        names
            Surfaces to keep.

        Returns
        -------
        LabelledWindows
            Those examples.
        (n,) bool
            Which of all examples they are.
        """
        rows = np.isin(self.labels, names)
        inputs = {
            topic: WindowBatch(
                item.samples[rows], item.rate_hz, item.speed_m_s[rows], item.force_n[rows], channels=item.channels
            )
            for topic, item in self.inputs.items()
        }
        return LabelledWindows(inputs, self.labels[rows], self.groups[rows]), rows

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The surfaces, in the order of their numbers."""
        return tuple(np.unique(self.labels).tolist())

    @cached_property
    def codes(self) -> Codes:
        """Number of each window's surface, (n,)."""
        codes: Codes = np.unique(self.labels, return_inverse=True)[1].reshape(-1)
        return codes

    @cached_property
    def slides(self) -> Codes:
        """Number of each window's slide, (n,)."""
        numbers: Codes = np.unique(self.groups, return_inverse=True)[1].reshape(-1)
        return numbers

    @cached_property
    def digest(self) -> str:
        """What tells these examples from others, in eight letters."""
        digest = hashlib.sha256()
        for name in ('labels', 'groups'):
            digest.update('\n'.join(getattr(self, name).tolist()).encode())
        for topic, windows in self.inputs.items():
            digest.update(topic.encode())
            digest.update(np.ascontiguousarray(windows.samples).tobytes())
        return digest.hexdigest()[:8]


# Cuts the windows that a recipe asks for; called with equal parameters, it should answer with the same object.
Cut = Callable[[WindowParams], LabelledWindows]


def _stacked(
    windows: Sequence[Window], topic: str, speed: NDArray[np.float64], force: NDArray[np.float64]
) -> WindowBatch:
    kinds = {(item.rate_hz, item.samples.shape, item.channels) for item in windows}
    if len(kinds) > 1:
        raise InvalidData(
            f"the windows of '{topic}' differ in rate, length or channels: "
            f'{sorted(str(kind) for kind in kinds)}; use slides of one sensor'
        )
    samples = np.stack([item.samples for item in windows])
    return WindowBatch(samples, windows[0].rate_hz, speed, force, channels=windows[0].channels)
