"""A model that is taught while it is used: by one more slide, at once, and back."""

from __future__ import annotations

import dataclasses
from collections import OrderedDict
from pathlib import Path

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import InvalidData
from texture_core.features import FeatureVector
from texture_core.labels import checked_label
from texture_estimation.incremental.added_examples import Lesson, remove_lesson, write_lesson
from texture_estimation.model import Model

# Explorations that can still be taught, and windows of each: the latest.
EXPLORATIONS, WINDOWS = 20, 600


class Pupil:
    """Knows a model and what was felt lately, and makes from both a model that knows more.

    Parameters
    ----------
    model
        Trained; what it was taught before is part of it.
    path
        Of the model: lessons are kept beside it. None keeps them in memory alone.

    Raises
    ------
    ModelMismatch
        If the model holds no examples to learn beside.
    """

    def __init__(self, model: Model, path: str | Path | None = None) -> None:
        self.model = model
        self._head = model.taught_head()
        self._path = path
        self._felt: OrderedDict[str, list[Array]] = OrderedDict()

    def remember(self, vector: FeatureVector) -> None:
        """Keep a window, in case it is taught."""
        if vector.last or vector.feature_set != self.model.feature_set or not np.isfinite(vector.values).all():
            return
        windows = self._felt.setdefault(vector.exploration_id, [])
        self._felt.move_to_end(vector.exploration_id)
        windows.append(vector.values)
        del windows[:-WINDOWS]
        while len(self._felt) > EXPLORATIONS:
            self._felt.popitem(last=False)

    def learn(self, label: str, exploration_id: str = '') -> int:
        """Learn an exploration, the last one if '', under a label; return how many examples of it are known now.

        Raises
        ------
        InvalidData
            If there is no label or a forbidden one, nothing usable was felt in that exploration, or it already stands
            under another label.
        OSError
            If the lesson cannot be kept; it has not been learnt then.
        """
        label = checked_label(label)
        if not label:
            raise InvalidData('no label was given; name the texture to learn')
        name = exploration_id or next(reversed(self._felt), '')
        if name not in self._felt:
            known = ', '.join(self._felt) or 'none'
            raise InvalidData(
                f"no usable window of exploration '{name}' was felt; explore first. Can be taught: {known}"
            )
        self._refuse_second_label(name, label)
        lesson = Lesson(label, name, np.stack(self._felt[name]))
        if self._path is not None:
            write_lesson(self._path, len(self.model.lessons) + 1, lesson, self.model.feature_set)
        self._become((*self.model.lessons, lesson), label)
        return len(self._head.examples_of(self.model.labels.index(label)))

    def _refuse_second_label(self, exploration_id: str, label: str) -> None:
        others = [kept.label for kept in self.model.lessons if kept.exploration_id == exploration_id != '']
        if others and label not in others:
            raise InvalidData(
                f"exploration '{exploration_id}' was added as '{others[-1]}'; it cannot be '{label}', too: "
                'undo that first, or explore again'
            )

    def undo(self) -> Lesson:
        """Unlearn the last lesson and return it.

        Raises
        ------
        InvalidData
            If nothing was taught.
        """
        if not self.model.lessons:
            raise InvalidData(f"model '{self.model.name}' was taught nothing that could be undone")
        *before, last = self.model.lessons
        if self._path is not None:
            remove_lesson(self._path, len(self.model.lessons))
        self._become(tuple(before), last.label)
        return last

    def _become(self, lessons: tuple[Lesson, ...], label: str) -> None:
        """Let the model know these lessons, of which only those of one label differ from before."""
        taught = self.model.with_lessons(lessons)
        labels = taught.labels if label in taught.labels else self.model.labels
        as_trained = label in taught.trained_labels and all(lesson.label != label for lesson in lessons)
        self._head.set_examples(labels.index(label), taught.examples_of(label), as_trained=as_trained)
        self.model = dataclasses.replace(taught, taught=self._head.judge if lessons else None)
