# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import dataclasses
import hashlib
import io
import json
import math
import resource
import subprocess
import sys
import zipfile

import numpy as np
import pytest

from texture_core.config import folder
from texture_core.errors import InvalidData, ModelMismatch
from texture_core.types import SlideMotion
from texture_estimation.model import AddedSlide, load_model, read_added_slides, write_added_slide, write_tree
from texture_estimation.recipe import load_recipe
from texture_estimation.roughness import Grades, load_roughness_recipe, train_grades
from texture_estimation.training import train
from texture_features.feature_set import SlideConditions

RECIPES = sorted(path.stem for path in folder('texture_estimation', 'config/recipes').glob('*.yaml'))
# Loads the models named first and predicts with each, in a Python without these libraries.
ALONE = """
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in {'sklearn', 'skops', 'joblib', 'pymoo', 'matplotlib', 'distributed'}:
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)
sys.meta_path.insert(0, Absent())
import numpy as np
from texture_core.types import FeatureVector
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.model import AddedSlide, load_model, read_added_slides, write_added_slide
from texture_estimation.roughness import RoughnessAccumulator, load_roughness_model
for kind, path in (given.split('=', 1) for given in sys.argv[1:]):
    roughness = kind == 'roughness'
    model = (load_roughness_model if roughness else load_model)(path)
    vector = FeatureVector(0, 'e1', 0.5, 0.1, model.names, np.ones(len(model.names)), feature_set=model.feature_set)
    estimate = (RoughnessAccumulator if roughness else EvidenceAccumulator)(model).update(vector)
    print(kind, estimate.windows)
"""


@pytest.fixture
def saved(model, tmp_path):
    return model.save(tmp_path / 'surfaces', facts={'accuracy': 0.98})


@pytest.mark.parametrize('ending', ['', '.npz', '.json'])
def test_a_model_predicts_the_same_after_it_was_saved(saved, model, examples, ending):
    loaded = load_model(saved.with_suffix(ending))
    np.testing.assert_array_equal(loaded.predict_log_proba(examples.values), model.predict_log_proba(examples.values))
    np.testing.assert_equal(loaded.tree, model.tree)


def test_models_of_all_shipped_recipes_answer_without_scikit_learn_and_skops(examples, make_examples, tmp_path):
    paths = [f'{name}={train(load_recipe(name), examples).save(tmp_path / name)}' for name in RECIPES]
    grades = Grades({label: 1.0 + number for number, label in enumerate(('cork', 'felt', 'slate', 'wood'))})
    rough = train_grades(load_roughness_recipe('roughness'), examples, grades).save(tmp_path / 'rough')
    reported = subprocess.run(
        [sys.executable, '-c', ALONE, *paths, f'roughness={rough}'], check=False, capture_output=True, text=True
    )
    assert reported.stderr == ''
    assert reported.stdout.split('\n')[:-1] == [f'{name} 1' for name in (*RECIPES, 'roughness')]


def test_the_card_holds_recipe_labels_and_facts(saved):
    card = json.loads(saved.with_suffix('.json').read_text())
    assert card['labels'] == ['cork', 'felt', 'slate', 'wood']
    assert card['recipe']['learner']['mlp']['hidden'] == 192
    assert card['accuracy'] == 0.98


def refused(path, match):
    with pytest.raises(ModelMismatch, match=match) as caught:
        load_model(path)
    assert '\n' not in str(caught.value)


def test_missing_files_are_refused(saved):
    refused(saved.parent / 'none.npz', 'there is no model')
    saved.unlink()
    refused(saved, 'belongs next to its model card')
    saved.write_bytes(b'')
    saved.with_suffix('.json').unlink()
    for given in (saved, saved.with_suffix('')):
        refused(given, r"no card '\S+\.json' next to '\S+\.npz'; copy both files of the model$")


@pytest.mark.parametrize('keep', [0, 10, 1000])
def test_truncated_files_are_refused(saved, keep):
    content = saved.read_bytes()
    saved.write_bytes(content[:keep])
    refused(saved, 'damaged or of another card')
    saved.write_bytes(content)
    card = saved.with_suffix('.json')
    card.write_text(card.read_text()[:keep])
    refused(saved, 'cannot be read')


@pytest.mark.parametrize('text', ['[]', '{}', '3', '{"format": 99}', '{"format": 1, "recipe": {}}'])
def test_foreign_cards_are_refused(saved, text):
    saved.with_suffix('.json').write_text(text)
    refused(saved, 'not the card of a model')


def rewrite(saved, content, **changes):
    """Put other arrays into the file, with a card that vouches for them."""
    saved.write_bytes(content)
    card = json.loads(saved.with_suffix('.json').read_text())
    card |= {'sha256': hashlib.sha256(content).hexdigest(), **changes}
    saved.with_suffix('.json').write_text(json.dumps(card))


def archive(name, write):
    content = io.BytesIO()
    with zipfile.ZipFile(content, 'w', zipfile.ZIP_DEFLATED) as file, file.open(name, 'w') as member:
        write(member)
    return content.getvalue()


def array_file(array, name='parameters/hidden.npy'):
    return archive(name, lambda member: np.lib.format.write_array(member, array, allow_pickle=True))


@pytest.mark.parametrize(
    ('content', 'sentence'),
    [
        (b'', 'not an archive'),
        (b'not a zip', 'not an archive'),
        (array_file(np.array([print])), 'no array that can be read'),
        (array_file(np.zeros(3, np.int8)), 'holds int8; float32, float64, int32, int64 are allowed'),
        (array_file(np.zeros(3), 'parameters/../../x.npy'), 'train it again'),
        (array_file(np.zeros(3), 'acceptance/domain.npy'), 'acceptance has the entries'),
    ],
)
def test_a_file_that_holds_no_arrays_of_a_model_is_refused(saved, content, sentence):
    rewrite(saved, content)
    refused(saved, f'{sentence}.*train it again|{sentence}')


def test_a_small_file_that_unpacks_to_more_than_a_model_has_is_refused_before_it_is_unpacked(saved):
    def zeros(member):
        for _ in range(301):
            member.write(bytes(1_000_000))

    content = archive('parameters/hidden.npy', zeros)
    assert len(content) < 1_000_000
    rewrite(saved, content)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    refused(saved, 'unpacks to more than 300 MB')
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 20_000  # kB


def test_parts_that_do_not_fit_the_card_are_refused(saved):
    content = saved.read_bytes()
    rewrite(saved, content, labels=['cork'])
    refused(saved, 'its model card names 1')
    rewrite(saved, content, features=['one'])
    refused(saved, 'train it again')


def test_a_model_of_slides_of_several_kinds_knows_them_after_it_was_saved(examples, tmp_path):
    motions = [SlideMotion('linear_slide', 0.0, 0.1, 2.0, 1.0), SlideMotion('linear_slide', 1.5, 0.1, 2.0, 1.0)]
    made = {slide: motions[int(slide[-1]) % 2] for slide in examples.groups.tolist()}
    model = train(load_recipe('default'), dataclasses.replace(examples, motions=made))
    loaded = load_model(model.save(tmp_path / 'choosing'))
    assert list(loaded.next_touch_model.motions) == motions
    slide = examples.values[examples.groups == 'felt/1'].mean(axis=0)
    known = model.next_touch_model
    belief = known.update(known.uniform_log_prior, motions[1], slide)
    np.testing.assert_array_equal(loaded.next_touch_model.update(known.uniform_log_prior, motions[1], slide), belief)
    assert known.textures[belief.argmax()] == 'felt'


def test_what_was_fitted_for_acceptance_is_the_same_after_it_was_saved(model, tmp_path):
    loaded = load_model(model.save(tmp_path / 'model')).acceptance
    assert loaded.limits(2.5) == model.acceptance.limits(2.5)
    assert (loaded.slides, loaded.rates, loaded.domain, loaded.decided_score) == (
        48, model.acceptance.rates, model.acceptance.domain, model.acceptance.decided_score
    )  # fmt: skip


@pytest.mark.parametrize(
    ('entry', 'value', 'sentence'),
    [
        ('rates', None, 'rates is None; the entries max_accepted_wrong'),
        ('rates', {'coverage': 0.9}, 'the entries coverage; max_accepted_wrong'),
        ('slides', True, 'slides is True'),
        ('slides', 12.5, 'slides is 12.5'),
        ('slides', -1, 'acceptance has -1 slides'),
        ('decided_score', -math.inf, 'finite ones of'),
        ('added', 3, 'added is 3'),
        ('domain', 'any', "domain is 'any'; the entries motions"),
        ('domain/speed_m_s', [0.2, 0.1], 'two rising numbers'),
        ('domain/force_n', [0.0, math.inf], 'two rising numbers'),
        ('domain/force_n', [1.0], r'force_n is \[1.0\]'),
        ('domain/directions_rad', [math.nan], 'finite ones are needed'),
        ('domain/speed_margin', math.inf, 'two rising numbers'),
    ],
)
def test_an_acceptance_of_no_such_numbers_is_refused_in_one_sentence(saved, entry, value, sentence):
    path = saved.with_suffix('.json')
    card = json.loads(path.read_text())
    *folder, name = entry.split('/')
    (card['acceptance'][folder[0]] if folder else card['acceptance'])[name] = value
    path.write_text(json.dumps(card))
    refused(saved, f"{sentence}.*; train it again with 'texture train'")


def test_the_conditions_of_an_added_slide_survive_its_file(tmp_path):
    known = SlideConditions('circular', speed_m_s=0.05, directions_rad=(0.5,), levels=(('signal/a', 2.0, 1.0, 3.0),))
    for number, conditions in enumerate((known, SlideConditions()), start=1):
        write_added_slide(tmp_path / 'm', number, AddedSlide('oak', 'slide', np.ones((3, 1)), conditions), 'a1')
    found = [slide.conditions for slide in read_added_slides(tmp_path / 'm', 'a1', ('mean',))]
    assert repr(found) == repr([known, SlideConditions()])  # NaN is not equal to itself


def test_a_tree_with_anything_but_arrays_and_plain_values_is_refused_and_leaves_no_file(tmp_path):
    with pytest.raises(InvalidData, match='must be arrays and plain values'):
        write_tree(tmp_path / 'own', {'recipe': {'learner': 'own'}, 'mean': np.zeros(2), 'own': object()})
    assert not list(tmp_path.iterdir())
