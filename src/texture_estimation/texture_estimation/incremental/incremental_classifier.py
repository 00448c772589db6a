"""Incremental classification: add one slide to a model while it is used, and remove it again."""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path

import numpy as np

from texture_core.arrays import Array
from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidData
from texture_core.features import FeatureVector
from texture_core.labels import checked_label
from texture_estimation.incremental.added_slides import (
    AddedSlide,
    remove_added_slide,
    stored_numbers,
    write_added_slide,
)
from texture_estimation.model import TextureModel
from texture_features.slide_conditions import RunningConditions

# Number of recent explorations that can be added, and of windows of each.
EXPLORATIONS, WINDOWS = 20, 600


class IncrementalClassifier:
    """Hold a model and the most recent windows, and update the model with slides of them.

    Parameters
    ----------
    model
        Trained model, including the slides added to it before.
    path
        Path of the model, beside which added slides are stored; None keeps them in memory only.

    Raises
    ------
    ModelMismatch
        If the model holds no training examples.

    Examples
    --------
    >>> from texture_estimation.classification.training import train
    >>> from texture_estimation.recipe import Recipe
    >>> from texture_features.labelled_features import LabelledFeatures
    >>> recipe = Recipe.from_mapping({'inputs': {'signal': {'features': ['mean']}}, 'learner': 'naive_bayes'}, 'tiny')
    >>> labels = np.repeat(['cork', 'felt'], 20)
    >>> slides = np.char.add(labels, np.tile(np.repeat(['/1', '/2', '/3', '/4'], 5), 2))
    >>> values = (labels == 'felt')[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 1))
    >>> model = train(recipe, LabelledFeatures(values, labels, slides, ('mean',), 'a1', 0.5, 0.1))
    >>> classifier = IncrementalClassifier(model)
    >>> classifier.observe(FeatureVector(0, 'new', 0.5, 0.1, ('mean',), np.array([3.0]), feature_set='a1'))
    >>> classifier.add('oak'), classifier.model.labels
    (1, ('cork', 'felt', 'oak'))
    >>> classifier.remove_last().label, classifier.model.labels
    ('oak', ('cork', 'felt'))
    """

    def __init__(self, model: TextureModel, path: str | Path | None = None) -> None:
        self.model = model.with_added_slides(model.added_slides)  # which fits the Gaussians before a slide is added
        self._path = path
        self._numbers = stored_numbers(path) if path is not None else []  # of the files, one for each added slide
        self._recent_windows: OrderedDict[str, list[Array]] = OrderedDict()
        self._conditions: dict[str, RunningConditions] = {}  # of the same explorations

    def observe(self, vector: FeatureVector) -> None:
        """Keep a window, so that its exploration can be added."""
        if vector.last or vector.feature_set != self.model.feature_set or not np.isfinite(vector.values).all():
            return
        windows = self._recent_windows.setdefault(vector.exploration_id, [])
        self._recent_windows.move_to_end(vector.exploration_id)
        windows.append(vector.values)
        del windows[:-WINDOWS]
        self._conditions.setdefault(vector.exploration_id, RunningConditions()).update(vector)
        while len(self._recent_windows) > EXPLORATIONS:
            oldest, _ = self._recent_windows.popitem(last=False)
            del self._conditions[oldest]

    def add(self, label: str, exploration_id: str = '') -> int:
        """Add an exploration, the last one if '', as examples of a label; return their number now.

        Raises
        ------
        InvalidData
            If there is no label or a forbidden one, nothing usable was measured in that exploration, or it already
            stands under another label.
        OSError
            If the slide cannot be stored; it has not been added then.
        """
        label = checked_label(label)
        if not label:
            raise InvalidData('no label was given; name the texture to add')
        name = exploration_id or next(reversed(self._recent_windows), '')
        if name not in self._recent_windows:
            known = ', '.join(self._recent_windows) or 'none'
            raise InvalidData(f"exploration '{name}' has no usable window; explore first. Can be added: {known}")
        self._refuse_second_label(name, label)
        added_slide = AddedSlide(label, name, np.stack(self._recent_windows[name]), self._conditions[name].get())
        if self._path is not None:
            self._store(self._path, added_slide)
        self.model = self.model.with_added_slides((*self.model.added_slides, added_slide))
        return len(self.model.examples_of(label))

    def _refuse_second_label(self, exploration_id: str, label: str) -> None:
        others = [kept.label for kept in self.model.added_slides if kept.exploration_id == exploration_id != '']
        if others and label not in others:
            raise InvalidData(
                f"exploration '{exploration_id}' was added as '{others[-1]}'; it cannot be '{label}', too: "
                'undo that first, or explore again'
            )

    def remove_last(self) -> AddedSlide:
        """Remove the slide that was added last, and return it.

        Raises
        ------
        InvalidData
            If no slide was added.
        """
        if not self.model.added_slides:
            raise InvalidData(f"model '{self.model.name}' has no added slides that could be removed")
        *before, last = self.model.added_slides
        if self._path is not None:
            remove_added_slide(self._path, self._numbers[-1])
            del self._numbers[-1]
        self.model = self.model.with_added_slides(tuple(before))
        return last

    def remove(self, label: str) -> tuple[AddedSlide, ...]:
        """Remove all slides that were added as a label, from the model and from its folder, and return them.

        A texture of the training stays as it was trained.

        Raises
        ------
        InvalidData
            If there is no label, no slide was added at all, or none to this texture of the training.
        UnknownName
            If no slide was added under this label, with the nearest label.
        OSError
            If a file cannot be removed; the slides whose files are still there stay in the model.
        """
        label = checked_label(label)
        self._refuse_removal(label)
        kept = list(self.model.added_slides)
        removed = []
        try:
            for place in reversed([place for place, slide in enumerate(kept) if slide.label == label]):
                if self._path is not None:
                    remove_added_slide(self._path, self._numbers[place])
                    del self._numbers[place]
                removed.append(kept.pop(place))
        finally:
            self.model = self.model.with_added_slides(tuple(kept))
        return tuple(reversed(removed))

    def _store(self, path: str | Path, added_slide: AddedSlide) -> None:
        number = self._numbers[-1] + 1 if self._numbers else 1
        write_added_slide(path, number, added_slide, self.model.feature_set)
        self._numbers.append(number)

    def _refuse_removal(self, label: str) -> None:
        added = sorted({slide.label for slide in self.model.added_slides})
        if not added:
            raise InvalidData(f"model '{self.model.name}' has no added slides that could be removed")
        allowed = f'Can be removed: {", ".join(added)}'
        if not label:
            raise InvalidData(f'no label was given; name the texture to remove. {allowed}')
        if label in added:
            return
        if label in self.model.trained_labels:
            raise InvalidData(
                f"'{label}' is of the training, and no slide was added to it; to remove it, "
                f'train the model again without it. {allowed}'
            )
        raise unknown_name(label, added, 'added texture')
