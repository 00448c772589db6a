# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Learn after the training from a few slides, while the model is used."""

from __future__ import annotations

import enum
from collections import OrderedDict
from pathlib import Path

import numpy as np

from texture_core.config import unknown_name
from texture_core.errors import InvalidData
from texture_core.types import Array, FeatureVector, checked_label
from texture_estimation.model import (
    BROKEN,
    AddedSlide,
    TextureModel,
    remove_added_slide,
    stored_numbers,
    write_added_slide,
)
from texture_features.feature_set import RunningConditions

# Number of recent explorations that can be added, and of windows of each.
EXPLORATIONS, WINDOWS = 20, 600


class ChangeError(enum.IntEnum):
    """Why a texture was not added or removed: `error_code` of the services, which describe each value."""

    NONE = 0
    INTERNAL = 1
    NO_MODEL = 10
    INVALID_LABEL = 11
    NO_SLIDE = 12
    ALREADY_ADDED = 13
    NOT_STORED = 14
    NOT_ADDED = 15


class ChangeRefused(InvalidData):
    """A slide that cannot be added, or a texture that cannot be removed."""

    def __init__(self, sentence: str, error: ChangeError) -> None:
        super().__init__(sentence)
        self.error = error


class IncrementalClassifier:
    """Hold a model and the most recent windows, and update the model with slides of them."""

    def __init__(self, model: TextureModel, path: str | Path | None = None) -> None:
        self.model = model
        self._path = path
        self._numbers = stored_numbers(path) if path is not None else []  # of the files, one for each added slide
        self._recent_windows: OrderedDict[str, list[Array]] = OrderedDict()
        self._conditions: dict[str, RunningConditions] = {}  # of the same explorations
        self._aborted: set[str] = set()  # of them
        self._running: str | None = None  # the exploration that has not ended
        self._sliding: str | None = None  # the one whose last window has not come

    def begin(self, exploration_id: str) -> None:
        """Note an exploration as the newest one: if it ends before it slides, no earlier one takes its place."""
        self._running, self._sliding = exploration_id, None
        self._recent_windows_of(exploration_id)

    def end(self, exploration_id: str, *, aborted: bool) -> None:
        """Note that no exploration runs any more; an aborted one is not added."""
        self._running = None
        if aborted:
            self._aborted.add(exploration_id)

    def observe(self, vector: FeatureVector) -> None:
        """Keep a window, so that its exploration can be added."""
        windows = self._recent_windows_of(vector.exploration_id)
        self._sliding = None if vector.last else vector.exploration_id
        if vector.last or vector.feature_set != self.model.feature_set or not np.isfinite(vector.values).all():
            return
        windows.append(vector.values)
        del windows[:-WINDOWS]
        self._conditions[vector.exploration_id].update(vector)

    def add(self, label: str, exploration_id: str = '') -> int:
        """Add the windows of an exploration, the last one if '', to a label; return the number of its windows now."""
        label = checked_label(label)
        if not label:
            raise ChangeRefused('no label was given; name the texture to add', ChangeError.INVALID_LABEL)
        name = exploration_id or next(reversed(self._recent_windows), '')
        if name in (self._running, self._sliding):
            raise ChangeRefused(f"exploration '{name}' is still running; wait for its end", ChangeError.NO_SLIDE)
        self._refuse_without_window(name)
        self._refuse_second_time(name, label)
        added_slide = AddedSlide(label, name, np.stack(self._recent_windows[name]), self._conditions[name].get())
        model = self.model.with_added_slides((*self.model.added_slides, added_slide))
        try:
            model.validate()
        except BROKEN as error:
            raise ChangeRefused(f"the slide '{name}' cannot be added: {error}", ChangeError.NO_SLIDE) from error
        if self._path is not None:
            number = self._numbers[-1] + 1 if self._numbers else 1
            write_added_slide(self._path, number, added_slide, self.model.feature_set)
            self._numbers.append(number)
        self.model = model
        return model.n_examples(label)

    def _recent_windows_of(self, exploration_id: str) -> list[Array]:
        """Return the kept windows of an exploration, which counts as the newest one, also while it has none."""
        windows = self._recent_windows.setdefault(exploration_id, [])
        self._conditions.setdefault(exploration_id, RunningConditions())
        self._recent_windows.move_to_end(exploration_id)
        while len(self._recent_windows) > EXPLORATIONS:
            oldest, _ = self._recent_windows.popitem(last=False)
            del self._conditions[oldest]
            self._aborted.discard(oldest)
        return windows

    def _refuse_without_window(self, exploration_id: str) -> None:
        if self._recent_windows.get(exploration_id) and exploration_id not in self._aborted:
            return
        if not self._recent_windows:
            raise ChangeRefused('no exploration was classified with this model; explore first', ChangeError.NO_SLIDE)
        reason = (
            f"exploration '{exploration_id}' was aborted, so its slide is not whole; explore again"
            if exploration_id in self._aborted
            else f"exploration '{exploration_id}' has no usable window: it ended before its slide or a window of it, "
            'its samples were lost, or its features do not fit the model'
            if exploration_id in self._recent_windows
            else f"no exploration '{exploration_id}' is among the last {EXPLORATIONS}"
        )
        usable = (name for name, windows in self._recent_windows.items() if windows and name not in self._aborted)
        raise ChangeRefused(f'{reason}. Can be added: {", ".join(usable) or "none"}', ChangeError.NO_SLIDE)

    def _refuse_second_time(self, exploration_id: str, label: str) -> None:
        """Refuse an exploration that was added before: counted twice, one slide would raise the confidence."""
        others = [kept.label for kept in self.model.added_slides if kept.exploration_id == exploration_id != '']
        if label in others:
            raise ChangeRefused(
                f"exploration '{exploration_id}' was added as '{label}' already; explore again, and add that slide",
                ChangeError.ALREADY_ADDED,
            )
        if others:
            raise ChangeRefused(
                f"exploration '{exploration_id}' was added as '{others[-1]}'; it cannot also be '{label}': "
                'undo that first, or explore again',
                ChangeError.ALREADY_ADDED,
            )

    def remove_last(self) -> AddedSlide:
        """Remove the slide that was added last, and return it."""
        if not self.model.added_slides:
            raise InvalidData(f"model '{self.model.name}' has no added slides that could be removed")
        return self._remove([len(self.model.added_slides) - 1])[0]

    def remove(self, label: str) -> tuple[AddedSlide, ...]:
        """Remove all slides that were added as a label, from the model and from its folder, and return them.

        A texture of the training stays as it was trained.
        """
        label = checked_label(label)
        self._refuse_removal(label)
        return self._remove([place for place, slide in enumerate(self.model.added_slides) if slide.label == label])

    def _remove(self, places: list[int]) -> tuple[AddedSlide, ...]:
        """Remove slides by their rising places, the last first, and return them; what could not be removed stays."""
        kept, removed = list(self.model.added_slides), []
        try:
            for place in reversed(places):
                if self._path is not None:
                    remove_added_slide(self._path, self._numbers[place])
                    del self._numbers[place]
                removed.append(kept.pop(place))
        finally:
            self.model = self.model.with_added_slides(tuple(kept))
        return tuple(reversed(removed))

    def _refuse_removal(self, label: str) -> None:
        added = sorted({slide.label for slide in self.model.added_slides})
        if not added:
            raise ChangeRefused(
                f"model '{self.model.name}' has no added slides that could be removed", ChangeError.NOT_ADDED
            )
        allowed = f'Can be removed: {", ".join(added)}'
        if not label:
            raise ChangeRefused(f'no label was given; name the texture to remove. {allowed}', ChangeError.INVALID_LABEL)
        if label in added:
            return
        if label in self.model.trained_labels:
            raise ChangeRefused(
                f"'{label}' is of the training, and no slide was added to it; to remove it, "
                f'train the model again without it. {allowed}',
                ChangeError.NOT_ADDED,
            )
        raise unknown_name(label, added, 'added texture')
