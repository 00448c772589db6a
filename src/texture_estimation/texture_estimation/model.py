# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A trained model and its files: NAME.npz, the card NAME.json, and the slides added since in the folder NAME.added.

Adding slides does not change the two files.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import struct
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from texture_core.config import MAX_CARD_BYTES, MB, Arrays, FileRefused, load_json, read_bounded, safe_repr
from texture_core.errors import InvalidData, MissingLibrary, ModelMismatch, TextureError
from texture_core.types import AnyArray, Array
from texture_estimation.acceptance import Acceptance
from texture_estimation.gaussians import compared_start
from texture_estimation.learners.discriminant import linear_discriminant
from texture_estimation.learners.learner import NOT_COMPARED, Codes, Predictor, hidden_layer, is_tied, log_softmax
from texture_estimation.learners.mlp import MlpPredictor
from texture_estimation.next_motion import NextTouchModel
from texture_estimation.recipe import Recipe
from texture_features.correction import CORRECTED, read_correction
from texture_features.feature_set import SlideConditions

# --------------------
# The parts of a model as a tree: mappings, lists, plain values, and arrays as leaves.


def tree_of(part: Any) -> Any:
    """Return a part of a model as a tree: of a dataclass its fields by name."""
    if is_dataclass(part) and not isinstance(part, type):
        return {item.name: tree_of(getattr(part, item.name)) for item in fields(part)}
    if isinstance(part, Mapping):
        return {str(name): tree_of(value) for name, value in part.items()}
    return [tree_of(value) for value in part] if isinstance(part, tuple | list) else part


def part_of(kind: Any, value: Any, where: str) -> Any:
    """Return what `tree_of` made a tree of."""
    origin, given = get_origin(kind), get_args(kind)
    found: Any = None
    if is_dataclass(kind):
        types = get_type_hints(kind)
        if not isinstance(value, Mapping):
            raise InvalidData(f'{where} is {safe_repr(value):.80}; the entries {", ".join(types)} are needed')
        if set(types) != set(value):
            raise InvalidData(f'{where} has the entries {", ".join(value)}; {", ".join(types)} are needed')
        parts = {name: part_of(part_kind, value[name], f'{where}, {name}') for name, part_kind in types.items()}
        found = kind(**parts)  # type: ignore[operator]
    elif origin is UnionType:  # such a part or None
        return None if value is None else part_of(given[0], value, where)
    elif origin is tuple and isinstance(value, list) and (given[-1] is ... or len(given) == len(value)):
        kinds = given[:1] * len(value) if given[-1] is ... else given
        found = tuple(part_of(part_kind, item, where) for part_kind, item in zip(kinds, value, strict=True))
    elif origin is Mapping and isinstance(value, Mapping):
        found = {name: part_of(given[1], item, f'{where}, {name}') for name, item in value.items()}
    elif origin is np.ndarray and isinstance(value, np.ndarray) and value.dtype == get_args(given[1])[0]:
        found = value
    elif kind is float and isinstance(value, int | float) and not isinstance(value, bool):
        found = float(value)
    elif kind is Any or (isinstance(kind, type) and type(value) is kind):
        return value
    if found is None:
        raise InvalidData(f'{where} is {safe_repr(value):.80}; {kind} is needed')
    return found


# --------------------
# The two files that hold a model, whatever it answers: the tree as the card NAME.json, the arrays in it as NAME.npz.

FORMAT = 2  # the levels of the domain are by feature
ENDINGS = ('.npz', '.json')
MAX_BYTES = 200 * MB  # of a file of arrays; ensembles of networks over many features come to 20 MB
MAX_UNPACKED_BYTES = 300 * MB  # predictors hold copies of arrays: so a model takes less than 1 GB
NUMBERS = ('float32', 'float64', 'int32', 'int64')  # smaller types would grow when they are computed with
# What unpacking, and using what came out, raises at files that are damaged or made to do harm, found by trying.
BROKEN = (
    TextureError, LookupError, TypeError, ValueError, AttributeError, ArithmeticError, MemoryError, RuntimeError,
    ImportError, EOFError, SyntaxError, struct.error, zipfile.BadZipFile,
)  # fmt: skip


@contextmanager
def usable(target: Path) -> Iterator[None]:
    """Report, within a `with` block, that the files of a model cannot be used."""
    try:
        yield
    except MissingLibrary:
        raise
    except BROKEN as error:
        raise ModelMismatch(
            f"model '{target}' cannot be used: {type(error).__name__}: {error}; train it again with 'texture train'"
        ) from error


def model_stem(path: str | Path) -> Path:
    """Return the path without the ending of either file."""
    path = Path(path).expanduser()
    if path.name in ('', '..'):
        raise ModelMismatch(f"'{path}' is a folder, and no name of a model; give a path such as models/mine")
    return path.with_suffix('') if path.suffix in ENDINGS else path


def both_files(path: str | Path) -> tuple[Path, Path]:
    """Return NAME.npz and NAME.json of a model that is named by either, or by both without the ending."""
    target = model_stem(path)
    arrays, card = (target.with_name(target.name + ending) for ending in ENDINGS)
    return arrays, card


def write_tree(path: str | Path, tree: Mapping[str, Any]) -> Path:
    """Write NAME.npz and NAME.json, and return NAME.npz.

    A reader never sees half a file: both are written to temporary files and then moved.
    """
    arrays_path, card_path = both_files(path)
    card_path.parent.mkdir(parents=True, exist_ok=True)
    arrays: dict[str, AnyArray] = {}
    card = _without_arrays(tree, '', arrays)
    packed = io.BytesIO()
    np.savez_compressed(packed, **arrays)  # type: ignore[arg-type]
    content = packed.getvalue()
    card = {'format': FORMAT, **card, 'sha256': hashlib.sha256(content).hexdigest()}
    try:
        text = json.dumps(card, indent=1) + '\n'
    except TypeError as error:
        raise InvalidData(
            f'this model cannot be saved: {error}; what a custom learner trains must be arrays and plain values'
        ) from error
    replace_file(arrays_path, content)
    replace_file(card_path, text.encode())
    return arrays_path


def _without_arrays(tree: Any, place: str, arrays: dict[str, AnyArray]) -> Any:
    """Return a tree without its arrays, which are added to a mapping by their places, such as 'parameters/mean'."""
    if isinstance(tree, np.ndarray):
        arrays[place] = tree
        return None
    if isinstance(tree, np.generic):
        return tree.item()
    if isinstance(tree, Mapping):
        kept = {name: _without_arrays(part, f'{place}/{name}'.lstrip('/'), arrays) for name, part in tree.items()}
        return {name: part for name, part in kept.items() if part is not None or tree[name] is None}
    if isinstance(tree, list):
        return [_without_arrays(part, f'{place}/{number}', arrays) for number, part in enumerate(tree)]
    return tree


def read_tree(path: str | Path, *, of: str) -> dict[str, Any]:
    """Return the tree that `write_tree` was given; nothing in the files is run."""
    arrays_path, _ = both_files(path)
    tree = read_card(path)
    if of not in tree['recipe']:
        answers, node = KINDS[of]
        raise ModelMismatch(f"model '{model_stem(path)}' {answers}; load it in the {node}")
    try:
        content = read_bounded(arrays_path, MAX_BYTES)
    except (OSError, FileRefused) as error:
        raise ModelMismatch(
            f"model file '{arrays_path}' cannot be read: {error}; it belongs next to its model card"
        ) from error
    if hashlib.sha256(content).hexdigest() != tree.get('sha256'):
        raise ModelMismatch(
            f"model file '{arrays_path}' is damaged or of another card; copy both files again or train again"
        )
    with usable(model_stem(path)):
        arrays = Arrays(io.BytesIO(content), MAX_UNPACKED_BYTES)
        for name in arrays.names:
            *way, last = name.split('/')
            place: Any = tree
            for step in way:
                place = place[int(step)] if isinstance(place, list) else place.setdefault(step, {})
            place[last] = _numbers(arrays[name], name)
    return tree


@dataclass(frozen=True, eq=False, kw_only=True)
class StoredModel:
    """What models of textures and of roughness have in common."""

    name: str
    names: tuple[str, ...]
    feature_set: str
    recipe: Any
    parameters: Mapping[str, Any]
    training: Mapping[str, Any] = field(default_factory=dict)

    @property
    def tree(self) -> dict[str, Any]:
        """What the two files hold: plain values, and arrays as leaves."""
        return {
            'name': self.name,
            'feature_set': self.feature_set.partition(CORRECTED)[0],
            'features': list(self.names),
            'training': tree_of(self.training),
            'recipe': self.recipe.as_mapping(),
            'recipe_name': self.recipe.name,
            'parameters': tree_of(self.parameters),
        }

    def save(self, path: str | Path, facts: Mapping[str, Any] | None = None) -> Path:
        """Write NAME.npz and NAME.json; `facts`, such as accuracies, are added to the card. Return NAME.npz.

        Slides added to a model are not written: they are stored next to the model to which they were added.
        """
        return write_tree(path, {**self.tree, **(facts or {})})


def common_parts(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of `StoredModel`, but for its recipe, from its tree; InvalidData if they have other types."""
    return {
        'name': part_of(str, tree.get('name'), 'name'),
        'feature_set': part_of(str, tree.get('feature_set'), 'feature_set'),
        'names': part_of(tuple[str, ...], tree.get('features'), 'features'),
        'training': part_of(Mapping[str, Any], tree.get('training'), 'training'),
        'parameters': part_of(Mapping[str, Any], tree.get('parameters'), 'parameters'),
    }


# What a model that does not name one of these in its recipe does, and where it belongs.
KINDS = {'learner': ('estimates roughness', 'roughness_estimator'), 'regressor': ('classifies textures', 'classifier')}
PACKED = 'packed'  # ends the name of an array of bytes, which a library unpacks


def _numbers(array: AnyArray, name: str) -> AnyArray:
    if array.dtype.name not in NUMBERS and not (name.endswith(PACKED) and array.dtype == np.uint8):
        raise InvalidData(f"its array '{name}' holds {array.dtype}; {', '.join(NUMBERS)} are allowed")
    return array


def replace_file(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    temporary = path.with_name(f'.{path.name}.{os.getpid()}')
    try:
        temporary.write_bytes(content)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def read_card(given: str | Path) -> dict[str, Any]:
    """Return what the card of a model holds."""
    arrays, path = both_files(given)
    try:
        card = load_json(path, MAX_CARD_BYTES)
    except FileNotFoundError as error:
        if arrays.is_file():
            raise ModelMismatch(
                f"there is no card '{path}' next to '{arrays}'; copy both files of the model"
            ) from error
        missing = f"card '{path}' of '{given}'" if Path(given).exists() else f"model '{given}'"
        raise ModelMismatch(f'there is no {missing}; give the path of a trained model') from error
    except (OSError, ValueError) as error:
        raise ModelMismatch(
            f"model card '{path}' cannot be read: {error}; '{given}' was given; give the path of a trained model"
        ) from error
    if not isinstance(card, dict) or card.get('format') != FORMAT or not isinstance(card.get('recipe'), dict):
        raise ModelMismatch(
            f"'{path}' is not the card of a model of format {FORMAT}; give the path of one, or train again"
        )
    return card


# --------------------
# Slides added to a model after its training, stored in the folder NAME.added next to it.

ADDED_SLIDES_MAX_BYTES = 20 * MB  # of a file; a slide of a minute with 200 features has 5


@dataclass(frozen=True, eq=False)
class AddedSlide:
    """One slide over a known surface."""

    label: str
    exploration_id: str
    values: Array
    conditions: SlideConditions = field(default_factory=SlideConditions)


def write_added_slide(model: str | Path, number: int, added_slide: AddedSlide, feature_set: str) -> Path:
    """Write an added slide of a model by its number, from 1, atomically."""
    content_of_slide = {**tree_of(added_slide), 'values': added_slide.values.tolist()}
    content = {'format': FORMAT, 'feature_set': feature_set, **content_of_slide}
    path = _folder(model) / f'{number:05d}.json'
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, (json.dumps(content) + '\n').encode())
    return path


def stored_numbers(model: str | Path) -> list[int]:
    """Return the numbers of the stored slides of a model, rising; those of removed slides are missing."""
    return sorted(int(path.stem) for path in _folder(model).glob('*.json') if path.stem.isdecimal())


def remove_added_slide(model: str | Path, number: int) -> None:
    """Remove an added slide if it exists."""
    (_folder(model) / f'{number:05d}.json').unlink(missing_ok=True)


def read_added_slides(model: str | Path, feature_set: str, names: Sequence[str]) -> tuple[AddedSlide, ...]:
    """Return the added slides of a model in their order; none if there is no folder.

    They hold features, so they stay valid when the model is trained again with the same features.
    """
    return tuple(_read(path, feature_set, len(names)) for path in sorted(_folder(model).glob('*.json')))


def _read(path: Path, feature_set: str, n_features: int) -> AddedSlide:
    try:
        content = load_json(path, ADDED_SLIDES_MAX_BYTES)
        values = np.array(content['values'], dtype=np.float64)
        conditions = part_of(SlideConditions, content['conditions'], 'conditions')
        added_slide = AddedSlide(str(content['label']), str(content['exploration_id']), values, conditions)
        of = str(content['feature_set'])
        if not np.isfinite(values).all():
            raise ValueError('it holds values that are not finite')
    except (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError, InvalidData) as error:
        raise ModelMismatch(
            f"added slide '{path}' cannot be read: {type(error).__name__}: {error}; remove it and add it again"
        ) from error
    # Corrected or not, features mean what they meant to the finger of the training.
    if (
        of.partition(CORRECTED)[0] != feature_set.partition(CORRECTED)[0]
        or values.ndim != 2
        or values.shape[1] != n_features
        or not added_slide.label
    ):
        raise ModelMismatch(
            f"added slide '{path}' is of the features '{of}', the model has '{feature_set}'; "
            f"move the folder '{path.parent.name}' away, or use the model to which it was added"
        )
    return added_slide


def _folder(model: str | Path) -> Path:
    stem = model_stem(model)
    return stem.with_name(f'{stem.name}.added')


# --------------------
# Training examples that a model keeps for incremental training.

# Windows of a texture that are kept; more cost time and memory, and hardly help.
MAX_EXAMPLES = 400


@dataclass(frozen=True, eq=False)
class TrainingExamples:
    """Some of the windows that a model was trained on."""

    values: NDArray[np.float32]
    codes: Codes

    @classmethod
    def of(cls, values: Array, codes: Codes) -> TrainingExamples:
        """Return what contributes keeping: of each label at most as many as are useful."""
        of_label = [np.flatnonzero(codes == code) for code in range(int(codes.max()) + 1)]
        kept = np.concatenate([rows[spread(len(rows))] for rows in of_label])
        return cls(values[kept].astype(np.float32), codes[kept])


def spread(count: int, most: int = MAX_EXAMPLES) -> Codes:
    """Return at most `most` of the numbers 0 to count - 1, evenly spread."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(count, most)).round().astype(np.intp))


# --------------------
# The model.

# Of the discriminant of added textures. Chosen on slides 21-30 of recorded materials, trained on 1-20, five of twenty
# added: of the ten that the study of added textures, which tests on slides 31-40, never adds.
SHRINKAGE, INVERSE_TEMPERATURE = 0.3, 0.35


@dataclass(frozen=True, eq=False, kw_only=True)
class TextureModel(StoredModel):
    """Fitted parameters, and what is needed to classify a feature vector and to refuse an incompatible one.

    Parameters
    ----------
    labels
        Textures in the training set, in the order of the probabilities; added ones last.
    tempering_exponent
        Exponent of the effective window count in the evidence, 0 to 1.
    acceptance
        Whether a label is accepted, when a slide may end, and which labels it may have.
    next_touch_model
        Class-conditional Gaussians of each motion, to choose the next touch; None if all slides were alike.
    examples
        Training windows that are kept for incremental training; None if it holds none.
    added_slides
        Slides added after the training.

    Examples
    --------
    >>> import numpy as np
    >>> from texture_estimation.training import train
    >>> from texture_estimation.recipe import Recipe
    >>> from texture_features.feature_set import LabelledFeatures
    >>> learner = {'sklearn': {'estimator': 'sklearn.naive_bayes:GaussianNB'}}
    >>> recipe = Recipe.from_mapping({'inputs': {'signal': {'features': ['mean']}}, 'learner': learner}, 'tiny')
    >>> labels = np.repeat(['cork', 'felt'], 20)
    >>> slides = np.char.add(labels, np.tile(np.repeat(['/1', '/2', '/3', '/4'], 5), 2))
    >>> values = (labels == 'felt')[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 1))
    >>> model = train(recipe, LabelledFeatures(values, labels, slides, ('mean',), 'a1', 0.5, 0.1))
    >>> model.labels, model.decide(np.array([[0.05], [0.02]]))
    (('cork', 'felt'), ['cork', 'cork'])
    """

    labels: tuple[str, ...]
    recipe: Recipe
    tempering_exponent: float
    acceptance: Acceptance
    next_touch_model: NextTouchModel | None = None
    examples: TrainingExamples | None = None
    added_slides: tuple[AddedSlide, ...] = ()

    @cached_property
    def predictor(self) -> Predictor:
        """Predictor of the trained textures; of all textures, with what was added, if the learner learns online."""
        learner, parameters = self.recipe.learner, self.parameters
        if self.learns_online:
            for added in self.added_slides:
                code = self.labels.index(added.label)
                parameters = learner.partial_fit(parameters, added.values, code)  # type: ignore[attr-defined]
        return learner.predictor(parameters)

    @property
    def learns_online(self) -> bool:
        """Whether added slides update the learner itself; otherwise a discriminant distinguishes them."""
        return hasattr(self.recipe.learner, 'partial_fit')

    @cached_property
    def active_acceptance(self) -> Acceptance:
        """The acceptance with the added slides."""
        added, distance = self.added_slides, self.acceptance.distance
        if not added:
            return self.acceptance
        if distance is not None:
            windows = self.recipe.feature_set.windows
            overlap = min(windows.hop_s / windows.length_s, 1.0)
            means = [compared_start(self.compared(slide.values), overlap) for slide in added]
            distance = distance.with_slides(np.stack(means), np.array([self.labels.index(x.label) for x in added]))
        domain = self.acceptance.domain.widened([one.conditions for one in added], [one.label for one in added])
        return replace(self.acceptance, distance=distance, domain=domain)

    def acceptance_of(self, number: int) -> Acceptance:
        """Return the acceptance for the label of this number: few slides of an added one show little."""
        if number < self.n_trained:
            return self.active_acceptance
        label = self.labels[number]
        slides = sum(added.label == label for added in self.added_slides)
        return replace(self.active_acceptance, slides=slides, added=label)

    @cached_property
    def _hidden_layer(self) -> Callable[[Array], Array] | None:
        return hidden_layer(self.recipe.learner.predictor(self.parameters))

    @cached_property
    def _compared(self) -> Array:
        return np.array([name.rsplit('/', 1)[-1] not in NOT_COMPARED for name in self.names], dtype=np.float64)

    def compared(self, X: Array) -> Array:
        """Return what the distance compares: outputs of the trained hidden layer, (..., n_hidden), or the features."""
        return self._hidden_layer(X) if self._hidden_layer is not None else X * self._compared

    def predict_and_compare(self, X: Array) -> tuple[Array, Array]:
        """Return the log-probability of each label, up to a constant of the window, and what `compared` gives."""
        scores, compared = self._predict_trained(X)
        if self._added is None:
            return scores, compared
        # Trained textures keep the ratios of their probabilities; what was added to one of them is a separate class.
        weights, offsets, codes = self._added
        by_class = log_softmax(compared @ weights + offsets)
        log_proba, n = np.full((*scores.shape[:-1], len(self.labels)), -np.inf), self.n_trained
        log_proba[..., :n] = log_softmax(scores) + np.logaddexp.reduce(by_class[..., :n], axis=-1, keepdims=True)
        log_proba[..., codes] = np.logaddexp(log_proba[..., codes], by_class[..., n:])
        return log_proba, compared

    def _predict_trained(self, X: Array) -> tuple[Array, Array]:
        """Return what `predictor` and `compared` give, with the hidden layer computed once where both have it."""
        if isinstance(self.predictor, MlpPredictor):
            activations = self.predictor.activations(X)
            return self.predictor.scores(activations), activations
        return self.predictor(X), self.compared(X)

    @cached_property
    def _added(self) -> tuple[Array, Array, Codes] | None:
        """A discriminant of the trained and the added classes, (n_inputs, n_classes), and the labels of the added ones.

        Scores are no input of it: on the windows of the training those of trees are better than on any others. None if
        nothing was added, or if the learner itself learns it.
        """
        if not self.added_slides or self.examples is None or self.learns_online:
            return None
        codes = [self.labels.index(slide.label) for slide in self.added_slides for _ in slide.values]
        added, classes = np.unique(codes, return_inverse=True)
        windows = np.concatenate([self.examples.values, *(slide.values for slide in self.added_slides)])
        y = np.concatenate([self.examples.codes, self.n_trained + classes])
        weights, offsets = linear_discriminant(self.compared(windows), y, self.n_trained + len(added), SHRINKAGE)
        return INVERSE_TEMPERATURE * weights, INVERSE_TEMPERATURE * offsets, added

    def predict_log_proba(self, X: Array) -> Array:
        """Return the log-probability of each label, (..., n_labels) of (..., n_features).

        Parameters
        ----------
        X : (..., n_features)

        Returns
        -------
        (..., n_labels)
            Natural logarithms.
        """
        return log_softmax(self.predict_and_compare(X)[0])

    def decide(self, X: Array) -> list[str]:
        """Return the label of each window alone, (n,) of (n, n_features); '' where several labels are equally good.

        Parameters
        ----------
        X : (n_features,), or (n, n_features)
            Of the windows of one slide.
        """
        return self.best_labels(self.predict_log_proba(X))

    def best_labels(self, log_probabilities: Array) -> list[str]:
        """Return the most probable label of each row, (n, n_labels); '' where several labels are equally good."""
        best = log_probabilities.argmax(axis=-1).tolist()
        tied = is_tied(log_probabilities).tolist()
        return ['' if none else self.labels[index] for index, none in zip(best, tied, strict=True)]

    def with_added_slides(self, added_slides: tuple[AddedSlide, ...]) -> TextureModel:
        """Return the model with these added slides in place of those it has.

        Raises
        ------
        ModelMismatch
            If the model holds no training examples.
        """
        trained = self.trained_labels
        labels = (*trained, *dict.fromkeys(slide.label for slide in added_slides if slide.label not in trained))
        if self.examples is None:
            raise ModelMismatch(f"model '{self.name}' holds no training examples, so none can be added; train it again")
        return replace(self, labels=labels, added_slides=added_slides)

    @property
    def trained_labels(self) -> tuple[str, ...]:
        """Textures known from the training."""
        return self.labels[: self.n_trained]

    @cached_property
    def n_trained(self) -> int:
        """Number of textures known from the training."""
        return int(self.examples.codes.max()) + 1 if self.examples else len(self.labels)

    def n_examples(self, label: str) -> int:
        """Return how many windows of a label there are from training and added slides."""
        trained = self.examples is not None and label in self.labels
        known = int((self.examples.codes == self.labels.index(label)).sum()) if self.examples and trained else 0
        return known + sum(len(slide.values) for slide in self.added_slides if slide.label == label)

    def validate(self) -> None:
        """Predict and assess a window of zeros: parts that do not fit the others, or hold no numbers, raise now.

        Raises
        ------
        ModelMismatch
            If parts contradict each other, or a number is not finite or out of its range.
        """
        nothing = np.zeros(len(self.names))
        answer = self.predict_log_proba(nothing)
        if np.isnan(answer).any():
            raise ModelMismatch('its values are too large to be features')
        if answer.shape != (len(self.labels),):
            raise ModelMismatch(f'it answers {answer.shape} numbers, its model card names {len(self.labels)} labels')
        if self.acceptance.distance is not None:
            self.acceptance.assess(0.0, float(self.acceptance.distance.score(self.compared(nothing), 0)), 1.0)
            self.acceptance.members(np.exp(answer), 1.0)
        if not 0.0 <= self.tempering_exponent <= 1.0:
            raise ModelMismatch(f'the exponent of its evidence is {self.tempering_exponent}; allowed is 0 to 1')

    @property
    def tree(self) -> dict[str, Any]:
        """What the two files hold: plain values, and arrays as leaves."""
        return {
            **super().tree,
            'labels': list(self.trained_labels),
            'tempering_exponent': self.tempering_exponent,
            'acceptance': tree_of(self.acceptance),
            'next_touch_model': tree_of(self.next_touch_model),
            'examples': tree_of(self.examples),
        }


def load_model(path: str | Path) -> TextureModel:
    """Read a model with its added slides. No code in the files is run.

    Parameters
    ----------
    path
        Of either file, or of both without the ending.

    Raises
    ------
    ModelMismatch
        With one sentence, if a file is missing, damaged, foreign or does not belong to the other.
    """
    target = model_stem(path)
    tree = read_tree(path, of='learner')
    with usable(target):
        recipe = Recipe.from_mapping(tree['recipe'], str(tree['recipe_name']))
        common = common_parts(tree)
        correction = read_correction(target)
        if correction is not None:
            recipe = replace(recipe, feature_set=replace(recipe.feature_set, correction=correction))
            common['feature_set'] += f'{CORRECTED}{correction.fingerprint}'
        acceptance = part_of(Acceptance, tree.get('acceptance'), 'acceptance')
        if correction is not None:
            acceptance = replace(acceptance, domain=acceptance.domain.corrected(correction))
        model = TextureModel(
            **common,
            recipe=recipe,
            labels=part_of(tuple[str, ...], tree.get('labels'), 'labels'),
            tempering_exponent=part_of(float, tree.get('tempering_exponent'), 'tempering_exponent'),
            acceptance=acceptance,
            next_touch_model=part_of(NextTouchModel | None, tree.get('next_touch_model'), 'next_touch_model'),
            examples=part_of(TrainingExamples | None, tree.get('examples'), 'examples'),
        )
        model.validate()
    added_slides = read_added_slides(target, model.feature_set, model.names)
    if not added_slides:
        return model
    try:
        with_added = model.with_added_slides(added_slides)
        with_added.validate()
        return with_added
    except BROKEN as error:
        raise ModelMismatch(f"the added slides of model '{target}' cannot be used: {error}; move them away") from error
