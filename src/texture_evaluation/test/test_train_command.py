# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from texture_core.config import check_outputs
from texture_core.errors import InvalidParameter, ModelMismatch
from texture_core.types import TactileSignal
from texture_estimation.model import TextureModel, both_files, load_model
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.roughness import load_roughness_model
from texture_estimation.training import train
from texture_evaluation.charts import refuse_chart_format
from texture_evaluation.commands.train import graded_summary, summary
from texture_evaluation.evaluate import evaluate
from texture_evaluation.evaluate import summary as report_summary
from texture_evaluation.train import train_from_bags, train_grades_from_bags, training_examples
from texture_features.feature_set import LabelledFeatures, read_recipe
from texture_recordings.bags import BagWriter, read_bag
from texture_recordings.dataset import SlideDataset
from texture_recordings.mapping import mapping_from
from texture_recordings.tables import import_tables


@pytest.fixture(scope='module')
def model() -> TextureModel:
    recipe = Recipe.from_mapping(
        {
            'inputs': {'signal': {'features': ['mean']}},
            'learner': {'sklearn': {'estimator': 'sklearn.naive_bayes:GaussianNB'}},
        },
        'tiny',
    )
    labels = np.repeat(['cork', 'felt'], 15)
    slides = np.char.add(labels, np.tile(np.repeat(['/1', '/2', '/3'], 5), 2))
    values = (labels == 'felt')[:, None] + 0.1 * np.random.default_rng(0).standard_normal((30, 1))
    return train(recipe, LabelledFeatures(values, labels, slides, ('mean',), 'a1', 0.5, 0.1))


def test_the_training_reports_when_its_slides_are_too_few_to_decide(model: TextureModel) -> None:
    lines = summary(model, Path('model.npz'))
    assert lines[0] == "recipe 'tiny' trained on 2 surfaces: cork, felt"
    assert lines[2] == model.acceptance.reason
    assert 'too little training: 6 slides could be held out' in lines[2]


def test_where_a_finger_that_feels_nothing_is_not_recognised_training_and_card_name_it(
    model: TextureModel, simulated: Path, tmp_path: Path
) -> None:
    sentence = 'a finger that feels nothing cannot be told from a quiet surface'
    assert f'no feature is the power of signal: {sentence}' in summary(model, Path('model.npz'))
    dataset = SlideDataset.from_bags([simulated], '1-2')
    imported = SlideDataset(tuple(replace(slide, states=slide.sliding) for slide in dataset))
    recipe = load_recipe('default')
    for slides, named in ((dataset, False), (imported, True)):
        train(recipe, training_examples(recipe, slides)).save(tmp_path / 'mine')
        lines = summary(load_model(tmp_path / 'mine'), tmp_path / 'mine')
        assert (f'no approach of 10 samples was recorded: {sentence}' in lines) is named


@pytest.mark.parametrize(
    ('slides', 'expected'),
    [({'cork': 4, 'felt': 1}, 'few slides of felt: 1, of others up to 4'), ({'cork': 4, 'felt': 3}, '')],
)
def test_a_surface_with_far_fewer_slides_than_others_is_named(model: TextureModel, slides: dict, expected: str) -> None:
    domain = replace(model.acceptance.domain, slides=slides)
    uneven = replace(model, acceptance=replace(model.acceptance, domain=domain))
    found = [line for line in summary(uneven, Path('model.npz')) if line.startswith('few slides')]
    assert [line.partition(';')[0] for line in found] == ([expected] if expected else [])


@pytest.mark.parametrize(('fewest', 'shown'), [(4, False), (5, True)])
def test_an_accuracy_is_shown_from_five_slides_of_each_surface_on(
    model: TextureModel, fewest: int, shown: bool
) -> None:
    domain = replace(model.acceptance.domain, slides={'cork': 75, 'felt': fewest})
    training = {**model.training, 'held_out_window_accuracy': 0.5}  # that of chance
    few = replace(model, training=training, acceptance=replace(model.acceptance, domain=domain))
    lines = summary(few, Path('model.npz'))
    why = 'as a surface has 4 of the 5 slides that each needs; record more'
    assert lines[1].endswith(f'; no accuracy can be measured, {why}') != shown
    assert ('; 50.0 % accuracy of held-out windows' in lines[1]) == shown
    assert any('is not above chance' in line for line in lines) == shown


def test_the_training_reports_nothing_where_they_are_enough(model: TextureModel) -> None:
    domain = replace(model.acceptance.domain, slides={'cork': 75, 'felt': 75})
    enough = replace(model, acceptance=replace(model.acceptance, slides=150, domain=domain))
    assert not any('too ' in line for line in summary(enough, Path('model.npz')))


@pytest.fixture(scope='module')
def noise(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return bags of slides over two surfaces that nothing distinguishes."""
    folder = tmp_path_factory.mktemp('noise')
    samples = np.random.default_rng(0).normal(size=(40, 150))
    np.savez(folder / 'a.npz', X=samples[..., None], y=np.tile(['cork', 'felt'], 20))
    content = {
        'streams': {'signal': {'columns': ['X.*'], 'rate_hz': 100.0}}, 'label': {'column': 'y'},
        'slides': {'by': 'column', 'column': 'trial'}, 'conditions': {'speed': {'value': '0.05'}},
    }  # fmt: skip
    import_tables(mapping_from(content), folder / 'a.npz', folder / 'bags')
    return folder / 'bags'


@pytest.mark.parametrize(
    ('hop_s', 'warning'),
    [
        (0.1, r'\d+\.\d % accuracy of held-out windows is not above chance, 50\.0 % of 2'),
        (0.005, 'windows overlap more than'),
    ],
)
def test_a_recipe_that_does_not_fit_the_data_is_named(noise: Path, tmp_path: Path, hop_s: float, warning: str) -> None:
    (tmp_path / 'mine.yaml').write_text(
        f'windows: {{length_s: 0.5, hop_s: 0.1}}\ntraining: {{hop_s: {hop_s}}}\n'
        'inputs: {signal: {features: [mean, hjorth]}}\n'
        "learner: {sklearn: {estimator: 'sklearn.naive_bayes:GaussianNB'}}\n"
    )
    lines = summary(train_from_bags(str(tmp_path / 'mine.yaml'), [noise]), Path('model.npz'))
    assert any(re.match(f'warning: .*{warning}', line) for line in lines), lines


def test_a_recipe_of_taxels_names_the_streams_that_a_recording_of_vibration_has(noise: Path) -> None:
    with pytest.raises(ModelMismatch, match="has no 'signal_static', only signal; the windows need signal_static"):
        train_from_bags('taxels-any-day', [noise])


@pytest.mark.parametrize(('tared', 'faults'), [(True, 0), (False, 1)])
def test_a_stream_that_is_not_tared_as_the_recipe_states_is_reported(tared, faults, tmp_path, monkeypatch) -> None:
    samples = np.random.default_rng(0).normal(size=(8, 100, 3))
    made = SlideDataset.from_arrays({'signal': list(samples)}, ['cork', 'felt'] * 4, {'signal': 50.0}, sensor='skin')
    signals = [{'signal': (replace(slide.signals['signal'][0], tared=tared),)} for slide in made]
    slides = SlideDataset(tuple(replace(slide, signals=of) for slide, of in zip(made, signals, strict=True)))
    monkeypatch.setattr(SlideDataset, 'from_bags', lambda *_, **__: slides)
    content = {'learner': 'discriminant', 'inputs': {'signal': {'tare': 'tared', 'features': ['mean']}}}
    (tmp_path / 'mine.yaml').write_text(json.dumps(content))
    model = train_from_bags(str(tmp_path / 'mine.yaml'), [tmp_path])
    found = model.training.get('tare', []), evaluate(model, [tmp_path]).tare_faults
    assert [[sentence[:32] for sentence in of] for of in found] == [
        ["the recipe expects 'signal' tared"[:32]] * faults
    ] * 2


def test_training_names_the_slides_that_it_cannot_count_as_evaluation_does(tmp_path, monkeypatch) -> None:
    rng = np.random.default_rng(0)
    samples = [rng.normal(size=(length, 1)) for length in [1500] * 7 + [200]]
    slides = SlideDataset.from_arrays({'signal': samples}, ['cork', 'felt'] * 4, {'signal': 1000.0}, speed_m_s=0.05)
    monkeypatch.setattr(SlideDataset, 'from_bags', lambda *_, **__: slides)
    (tmp_path / 'mine.yaml').write_text('{learner: discriminant, inputs: {signal: {features: [mean]}}}')
    (tmp_path / 'grades.csv').write_text('texture,grade\ncork,1\nfelt,3\n')
    model = train_from_bags(str(tmp_path / 'mine.yaml'), [tmp_path])
    graded = train_grades_from_bags('roughness', [tmp_path], tmp_path / 'grades.csv')
    why = 'as each window lacks samples, has some that are NaN, or is longer than the slide'
    out = Path('model.npz')
    for lines in (summary(model, out), graded_summary(graded, out), report_summary(evaluate(model, [tmp_path]))):
        assert f'1 slide not counted, {why}: felt/4' in lines


def test_bags_and_grades_make_a_model_whose_card_lists_them(simulated, tmp_path) -> None:
    (tmp_path / 'grades.csv').write_text('texture,grade\nglass,1\nleather,3\nridge_2mm_deep,5\n')
    train_grades_from_bags('roughness', [simulated], tmp_path / 'grades.csv', '1-4', tmp_path / 'rough.npz')
    model = load_roughness_model(tmp_path / 'rough')
    assert model.name == 'rough'
    assert model.grades == {'glass': 1.0, 'leather': 3.0, 'ridge_2mm_deep': 5.0}
    card = json.loads((tmp_path / 'rough.json').read_text(encoding='utf-8'))
    assert card['data']['slides'] == '1-4'
    assert card['training']['slides'] == 12
    by_card, by_model = (read_recipe(str(tmp_path / name))[1] for name in ('rough.json', 'rough.npz'))
    assert by_card == by_model and 'inputs' in by_card


@pytest.mark.parametrize('output', ['m1.json', './m1.json', 'm1.npz', 'sub/../m1.json', 'own.yaml'])
def test_files_that_are_read_are_not_overwritten_and_another_may_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, output: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'sub').mkdir()
    for model in ('m1', 'm1.npz', 'm1.json'):
        with pytest.raises(InvalidParameter, match='would overwrite'):
            check_outputs([output], [*both_files(model), 'own.yaml'])
    with pytest.raises(InvalidParameter, match='its folder does not exist'):
        check_outputs(['nowhere/figures.json'], [])
    check_outputs(['figures.json', None], [*both_files('m1'), 'own.yaml', tmp_path / 'bags'])


def test_a_chart_is_a_png_svg_or_pdf_and_others_are_refused() -> None:
    for name in ('figures.png', 'figures.SVG', 'figures.pdf'):
        refuse_chart_format(name)
    for name in ('figures.yaml', 'figures', 'figures.json'):
        with pytest.raises(InvalidParameter, match=r'\.png, \.svg or \.pdf'):
            refuse_chart_format(name)


@pytest.fixture(scope='module')
def evaluated(simulated: Path) -> TextureModel:
    return train_from_bags('default', [simulated], '1-4')


def test_distinct_surfaces_are_recognised_and_the_figures_agree_with_each_other(
    evaluated: TextureModel, simulated: Path
) -> None:
    figures = evaluate(evaluated, [simulated], '5-6').as_json()
    assert (figures['shift'], figures['slides_in_training'], figures['n_slides']) == (
        'same bag; place not compared',
        [],
        6,
    )
    assert figures['n_slides_at_s'] == {'0.5': 6, '1.0': 6, '2.5': 0, '5.0': 0}
    assert figures['slide_accuracy_interval'] == [pytest.approx(0.05 ** (1 / 6)), 1.0]
    table = np.array(figures['confusion'])
    assert figures['window_accuracy'] == pytest.approx(np.trace(table) / table.sum())
    assert figures['window_accuracy'] > 0.9
    assert figures['accuracy_at_s'] == {'0.5': pytest.approx(1.0), '1.0': 1.0, '2.5': None, '5.0': None}
    assert figures['unknown_accepted'] is None
    assert (figures['accepted_wrong'], figures['rejected']) == (0.0, 1.0)  # four slides a surface are too few
    assert (figures['early'], figures['once_decided']) == (None, None)
    assert 0 < figures['latency_us']['median'] <= figures['latency_us']['p99']


def test_a_surface_that_adds_nothing_to_the_noise_of_the_sensor_is_named_and_rejected(
    evaluated: TextureModel, simulated: Path
) -> None:
    [sentence] = evaluated.training['quiet']  # the simulated glass: its relief is below a hundredth of the noise
    assert re.match(
        r"4 of 4 slides of 'glass' are as quiet as the sensor at rest, signal/dynamic 2\d.*, at rest 2\d", sentence
    ), sentence
    assert sentence in summary(evaluated, Path('model.npz'))
    ends = evaluate(evaluated, [simulated], '5-6').known
    assert {one.surface for one in ends if 'at rest' in one.end.message} == {'glass'}


def test_slides_of_the_training_are_named_whatever_their_bag_is_called(
    evaluated: TextureModel, simulated: Path, tmp_path: Path
) -> None:
    copies = tmp_path / 'other'
    copies.mkdir()
    for bag in simulated.iterdir():
        shutil.copytree(bag, copies / f'{bag.name}_again')
    report = evaluate(evaluated, [copies], '4-6')
    assert report.slides_in_training == ('glass/4', 'leather/4', 'ridge_2mm_deep/4')
    assert report.shift == 'other bag; place not compared'
    assert '3 of 9 slides were in the training' in '\n'.join(report_summary(report))


def test_surfaces_that_were_not_trained_count_as_unknown_alone(simulated: Path) -> None:
    evaluated = train_from_bags('default', [simulated / 'glass', simulated / 'leather'], '1-4')
    report = evaluate(evaluated, [simulated], '5-6')
    assert {result.surface for result in report.unknown} == {'ridge_2mm_deep'}
    assert report.confusion.shape == (2, 2)
    assert 0.0 <= report.as_json()['unknown_accepted'] <= 1.0


def test_a_model_is_saved_with_the_data_it_was_trained_on(simulated: Path, tmp_path: Path) -> None:
    train_from_bags('default', [simulated], '1-3', tmp_path / 'mine')
    assert load_model(tmp_path / 'mine').name == 'mine'
    card = json.loads((tmp_path / 'mine.json').read_text())
    assert card['data'] == {'bags': ['glass', 'leather', 'ridge_2mm_deep'], 'slides': '1-3'}
    assert evaluate(load_model(tmp_path / 'mine.npz'), [simulated], '4').as_json()['window_accuracy'] > 0.9


def test_another_rate_is_refused_and_nothing_is_scored(
    evaluated: TextureModel, simulated: Path, tmp_path: Path
) -> None:
    with BagWriter(tmp_path / 'slow') as bag:
        for topic, log_ns, value in read_bag(simulated / 'glass'):
            bag.write(topic, halved(value) if topic == 'signal' else value, log_ns)
    with pytest.raises(ModelMismatch, match="'signal' is 500 Hz, the model was trained at 1000 Hz"):
        evaluate(evaluated, [tmp_path / 'slow'])


def halved(signal: TactileSignal) -> TactileSignal:
    return replace(signal, sampling_rate_hz=500.0, first_sample=signal.first_sample // 2, samples=signal.samples[::2])
