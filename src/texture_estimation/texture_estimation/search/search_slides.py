"""The slides that a search classifies on, and how they are divided into halves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from texture_estimation.search.halves import Mask, random_halves
from texture_estimation.search.labelled_windows import Cut, LabelledWindows
from texture_features.windowing.windows import WindowParams


@dataclass(frozen=True, eq=False)
class SearchSlides:
    """Windows and halves of the same slides, however the windows are cut.

    Parameters
    ----------
    cut
        Gives the windows of all labelled slides.
    n_halves, seed
        How many random halves, and what they are drawn from.
    labels
        Surfaces to tell apart; () for all. The halves of some are those of all, less the other surfaces.

    Examples
    --------
    >>> import numpy as np
    >>> from texture_estimation.search.slide_arrays import ArrayStream, SlideArrays
    >>> samples = np.random.default_rng(0).standard_normal((8, 50, 1)) * np.repeat([1.0, 9.0], 4)[:, None, None]
    >>> labels = np.repeat(['cork', 'felt'], 4)
    >>> slides = SlideArrays({'signal': ArrayStream(samples, 100.0)}, labels, np.full(8, 0.05), np.ones(8))
    >>> halves = SearchSlides(slides, n_halves=5).halves(WindowParams(length_s=0.5, hop_s=0.5))
    >>> halves.sum(axis=1).tolist()  # half of the eight slides, each one window long
    [4, 4, 4, 4, 4]
    """

    cut: Cut
    n_halves: int = 20
    seed: int = 0
    labels: tuple[str, ...] = ()
    _known: dict[WindowParams, tuple[LabelledWindows, Mask, Mask]] = field(default_factory=dict, repr=False)

    def examples(self, windows: WindowParams) -> LabelledWindows:
        """Return the windows."""
        return self._split(windows)[0]

    def halves(self, windows: WindowParams) -> Mask:
        """Return which windows are used for training in each half, (n_halves, n).

        Returns
        -------
        (n_halves, n) bool
            True for training.
        """
        return self._split(windows)[1]

    def rows(self, windows: WindowParams) -> Mask:
        """Return which of all windows that `cut` gives are those, (n_all,).

        Returns
        -------
        (n_all,) bool
        """
        return self._split(windows)[2]

    def only(self, labels: Sequence[str]) -> SearchSlides:
        """Return the same split of some surfaces alone."""
        return SearchSlides(self.cut, self.n_halves, self.seed, tuple(labels))

    def _split(self, windows: WindowParams) -> tuple[LabelledWindows, Mask, Mask]:
        if windows not in self._known:
            examples = self.cut(windows)
            halves = random_halves(examples.codes, examples.slides, self.n_halves, np.random.default_rng(self.seed))
            rows: Mask = np.ones(len(examples.codes), dtype=bool)
            if self.labels:
                examples, rows = examples.of(self.labels)
                halves = halves[:, rows]
            self._known[windows] = (examples, halves, rows)
        return self._known[windows]
