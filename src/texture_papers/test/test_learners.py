# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every learner must do, and what each of the papers' must do as scikit-learn does it."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import minimize
from sklearn.mixture import GaussianMixture
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import FeatureVector
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.incremental import IncrementalClassifier
from texture_estimation.learners.learner import is_tied, log_softmax
from texture_estimation.model import load_model
from texture_estimation.recipe import LEARNERS, Recipe
from texture_estimation.training import train
from texture_papers.hu import SvmMaxWins, principal_components
from texture_papers.kaboli import (
    EmMixture,
    PassiveAggressive,
    SvmLinear,
    move_true_and_rival,
)
from texture_papers.roberge import Network, SvmPairs, fit_network, pairs_won

# What the papers add: the shared checks also hold for it.
PAPERS = (
    *(f'texture_papers.roberge:{name}' for name in ('AnnPairs', 'SvmPairs', 'TunedPairs')),
    *(f'texture_papers.kaboli:{name}' for name in ('SvmLinear', 'PassiveAggressive', 'EmMixture')),
    'texture_papers.hu:SvmMaxWins',
)
# Less of what takes time only.
FASTER = {'texture_papers.kaboli:SvmLinear': {'repeats': 2, 'candidates': 5}}


def learn(name, examples):
    recipe = {'inputs': {'signal': {'features': ['hjorth']}}, 'learner': {name: FASTER.get(name, {})}}
    return train(Recipe.from_mapping(recipe, name), examples)


def codes_of(examples):
    return tuple(np.unique(column, return_inverse=True)[1] for column in (examples.labels, examples.groups))


def accuracy(model, examples):
    return np.mean(np.array(model.decide(examples.values)) == examples.labels)


@pytest.fixture(scope='module', params=[*LEARNERS, *PAPERS])
def name(request):
    return request.param


@pytest.fixture(scope='module')
def training(name, examples):
    return learn(name, examples)


def test_distinct_surfaces_are_recognised(training, make_examples):
    assert accuracy(training, make_examples(seed=1)) > 0.85


def test_answers_are_log_probabilities_of_finite_size_even_far_from_all_examples(training, examples):
    for values in (examples.values, np.full((1, 6), 1e6), np.zeros((1, 6)), -examples.values):
        answers = training.predict_log_proba(values)
        assert np.isfinite(answers).all()
        np.testing.assert_allclose(np.exp(answers).sum(axis=1), 1.0)


def test_a_window_alone_gets_the_same_decision_as_in_a_batch(training, examples):
    together = training.predict_log_proba(examples.values)
    alone = np.stack([training.predict_log_proba(values) for values in examples.values])
    np.testing.assert_allclose(alone, together, atol=1e-9)
    assert [training.decide(values[None])[0] for values in examples.values] == training.decide(examples.values)


def test_a_model_predicts_the_same_after_it_was_saved(training, examples, tmp_path):
    loaded = load_model(training.save(tmp_path / 'm'))
    np.testing.assert_array_equal(
        loaded.predict_log_proba(examples.values), training.predict_log_proba(examples.values)
    )


@pytest.mark.parametrize('factor', [1e-6, 1e6])
def test_the_unit_of_the_features_does_not_matter(training, name, examples, factor):
    scaled = dataclasses.replace(examples, values=examples.values * factor)
    agree = np.array(learn(name, scaled).decide(scaled.values)) == np.array(training.decide(examples.values))
    assert agree.mean() > 0.97  # what is iterated may stop a hair elsewhere


@pytest.mark.parametrize(
    'more',
    [lambda values: values, lambda values: np.full_like(values, 0.1), lambda values: 1e6 + 1e-9 * values],
    ids=['duplicated', 'constant', 'almost constant'],
)
def test_features_that_report_nothing_new_do_no_harm(name, make_examples, more):
    def widened(examples):
        values = np.concatenate((examples.values, more(examples.values)), axis=1)
        return dataclasses.replace(examples, values=values, names=tuple(map(str, range(values.shape[1]))))

    model, fresh = learn(name, widened(make_examples())), widened(make_examples(seed=1))
    assert np.isfinite(model.predict_log_proba(fresh.values)).all()
    # Clusters are found without labels; the components of Hu et al. take the features to be of one unit.
    least = {'texture_papers.kaboli:EmMixture': 0.5, 'texture_papers.hu:SvmMaxWins': 0.2}
    assert accuracy(model, fresh) > least.get(name, 0.85)


@pytest.mark.parametrize(('slides', 'windows'), [(1, 1), (2, 1), (1, 2)])
def test_one_or_two_windows_of_a_label_are_enough_to_answer(name, make_examples, slides, windows):
    examples = make_examples(slides=slides, windows=windows)
    model = learn(name, examples)
    assert np.isfinite(model.predict_log_proba(examples.values)).all()
    assert model.labels == ('cork', 'felt', 'slate', 'wood')


def test_a_single_label_is_refused_with_a_sentence(name, make_examples):
    with pytest.raises(InvalidData, match="all windows are of 'cork'"):
        learn(name, make_examples(labels=('cork',)))


# Each against scikit-learn, on other examples than those trained on


@pytest.fixture(scope='module', params=[2, 5])
def task(request, make_examples):
    labels = tuple(f'm{number}' for number in range(request.param))
    examples = make_examples(labels=labels, spread=2.0)
    return examples, *codes_of(examples), make_examples(seed=5, labels=labels, spread=3.0).values


def evaluated(learner, examples, codes, groups, fresh):
    parameters = learner.fit(examples.values, codes, groups).parameters
    return learner.predictor(parameters), learner.predictor(parameters)(fresh)


def test_pairwise_machines_decide_as_scikit_learn_with_the_kernel_of_matlab(task):
    examples, codes, _, fresh = task
    _, answers = evaluated(SvmPairs(box_constraint=2.0, kernel_scale=4.0), *task)
    scaler = StandardScaler().fit(examples.values)
    svc = SVC(C=2.0, gamma=1.0 / 16.0).fit(scaler.transform(examples.values), codes)
    clear = ~is_tied(answers)
    assert clear.mean() > 0.9
    np.testing.assert_array_equal(answers.argmax(axis=1)[clear], svc.predict(scaler.transform(fresh))[clear])


def test_linear_machines_decide_every_window_as_scikit_learn(task):
    examples, codes, _, fresh = task
    learner = SvmLinear(least_c=0.5, most_c=0.5, candidates=1, repeats=1)
    _, answers = evaluated(learner, *task)
    scaler = StandardScaler().fit(examples.values)
    svc = SVC(C=0.5, kernel='linear', break_ties=True).fit(scaler.transform(examples.values), codes)
    np.testing.assert_array_equal(answers.argmax(axis=1), svc.predict(scaler.transform(fresh)))


def test_max_wins_on_principal_components_decides_every_window_as_scikit_learn(task):
    examples, codes, _, fresh = task
    learner = SvmMaxWins(variance=0.9, c=3.0)
    _, answers = evaluated(learner, *task)
    components = learner.fit(examples.values, codes, codes).parameters['components']
    project = lambda values: values @ components  # noqa: E731
    svc = SVC(C=3.0, gamma='scale', break_ties=True).fit(project(examples.values), codes)
    np.testing.assert_array_equal(answers.argmax(axis=1), svc.predict(project(fresh)))


def test_the_mixture_finds_the_clusters_of_scikit_learn(task):
    examples, codes, _, fresh = task
    _, answers = evaluated(EmMixture(starts=1), *task)
    scaler = StandardScaler().fit(examples.values)
    mixture = GaussianMixture(len(np.unique(codes)), covariance_type='diag', reg_covar=1e-3, random_state=0).fit(
        scaler.transform(examples.values)
    )
    found = np.exp(answers).argmax(axis=1)
    clusters = mixture.predict(scaler.transform(fresh))
    assert all(len(np.unique(found[clusters == cluster])) == 1 for cluster in np.unique(clusters))


# The parts that learners are made of


def test_votes_are_counted_and_a_tie_of_three_is_undecided():
    decisions = np.array([[1, 1, 1], [1, -1, 1], [-1, 1, -1]])
    assert pairs_won(decisions).tolist() == [[2, 1, 0], [1, 1, 1], [1, 1, 1]]
    assert is_tied(pairs_won(decisions)).tolist() == [False, True, True]
    assert pairs_won(np.array([3.0, -1.0, 1.0]), 'nearest').argmax() == 0


@pytest.mark.parametrize('transfer', ['sigmoid', 'linear'])
def test_the_jacobian_of_a_network_is_its_slope(transfer):
    rng = np.random.default_rng(0)
    network = Network.random(4, 3, rng, transfer)
    values = rng.normal(size=(5, 3))
    output, jacobian = network.jacobian(values)
    step = 1e-6 * rng.normal(size=jacobian.shape[1])
    np.testing.assert_allclose(network.moved(step)(values) - output, jacobian @ step, atol=1e-10)


@pytest.mark.parametrize('n_hidden', [1, 5])
def test_a_network_with_a_linear_hidden_layer_is_the_plane_of_least_squares(n_hidden):
    rng = np.random.default_rng(4)
    values, targets = rng.normal(size=(60, 3)), rng.normal(size=60)
    start = Network.random(n_hidden, 3, rng, 'linear')
    network = fit_network(start, values, targets, np.zeros(60, dtype=bool), 500)
    extended = np.column_stack((values, np.ones(60)))
    plane = np.linalg.lstsq(extended, targets, rcond=None)[0]
    np.testing.assert_allclose(network(values), extended @ plane, atol=1e-3)


def test_a_network_with_noise_stops_before_it_learns_the_noise():
    rng = np.random.default_rng(2)
    values, targets = rng.normal(size=(140, 5)), rng.integers(0, 2, 140).astype(float)
    held = np.arange(140) % 7 == 6
    network = fit_network(Network.random(20, 5, rng), values, targets, held, 200)
    assert np.mean((network(values[~held]) > 0.5) == targets[~held]) < 0.9


@pytest.mark.parametrize('c', [0.01, 1.0])
def test_multi_class_planes_move_as_little_as_the_example_demands(c):
    # Crammer et al. 2006, section 8: least ||W - W'||² / 2 + c · slack, the true label ahead of its strongest rival.
    rng = np.random.default_rng(3)
    for code in range(3):
        planes, values = rng.normal(size=(3, 4)), rng.normal(size=3)
        extended = np.append(values, 1.0)
        scores = planes @ extended
        rival = max(set(range(3)) - {code}, key=lambda label: scores[label])

        before = planes.ravel().copy()

        def cost(unknown, before=before):
            return 0.5 * np.square(unknown[:-1] - before).sum() + c * unknown[-1]

        def margin(unknown, code=code, rival=rival, extended=extended):
            weights = unknown[:-1].reshape(3, 4)
            return (weights[code] - weights[rival]) @ extended - 1.0 + unknown[-1]

        least = minimize(
            cost,
            np.append(planes.ravel(), 10.0),
            method='SLSQP',
            constraints=[{'type': 'ineq', 'fun': margin}, {'type': 'ineq', 'fun': lambda unknown: unknown[-1]}],
            options={'ftol': 1e-12, 'maxiter': 200},
        )
        move_true_and_rival(planes, values, code, c)
        np.testing.assert_allclose(planes, least.x[:-1].reshape(3, 4), atol=1e-4)


def test_more_passes_go_on_where_the_last_one_ended_and_fit_the_examples_better(make_examples):
    examples = make_examples(spread=2.0)
    codes, groups = codes_of(examples)
    one, ten, fifty = (
        PassiveAggressive(passes=passes).fit(examples.values, codes, groups).parameters for passes in (1, 10, 50)
    )
    planes = np.zeros_like(one['planes'])
    standard = (examples.values - one['mean']) / one['scale']
    order = np.argsort([np.sum(codes[:row] == codes[row]) for row in range(len(codes))], kind='stable')
    for row in [*order] * 10:
        move_true_and_rival(planes, standard[row], int(codes[row]), 1.0)
    np.testing.assert_allclose(ten['planes'], planes, atol=1e-9)
    right = [
        np.mean(PassiveAggressive.predictor(each)(examples.values).argmax(axis=1) == codes) for each in (one, fifty)
    ]
    assert right[0] < right[1]


@pytest.mark.parametrize('shape', [(50, 6), (5, 40)])
def test_principal_components_are_orthonormal_and_explain_what_they_should(shape):
    values = np.random.default_rng(0).normal(size=shape) * np.geomspace(1.0, 0.01, shape[1])
    centred = values - values.mean(axis=0)
    kept = principal_components(centred, 0.95)
    np.testing.assert_allclose(kept.T @ kept, np.eye(kept.shape[1]), atol=1e-9)
    explained = (centred @ kept).var(axis=0) / centred.var(axis=0).sum()
    assert explained.sum() >= 0.95 > explained[:-1].sum()


def test_components_of_examples_less_their_means_are_those_of_eq_7():
    values = np.random.default_rng(0).normal(size=(40, 6)) + np.arange(6.0) + np.arange(40.0)[:, None]
    codes = np.repeat([0, 1], 20)
    parameters = SvmMaxWins(variance=0.9).fit(values, codes, np.arange(40)).parameters
    centred = values - values.mean(axis=1, keepdims=True)  # eq. 7: the mean over k of x_i(k)
    variances, vectors = np.linalg.eigh(centred.T @ centred / 40)  # eq. 8
    fractions = np.cumsum(variances[::-1]) / variances.sum()  # eq. 10
    count = int((fractions < 0.9).sum()) + 1
    assert parameters['components'].shape == (6, count)
    projected = values @ parameters['components']
    np.testing.assert_allclose(np.abs(projected), np.abs(centred @ vectors[:, ::-1][:, :count]), atol=1e-9)


def test_two_directions_have_separate_components_and_odd_features_are_refused(examples):
    codes, groups = codes_of(examples)
    components = SvmMaxWins(blocks=2).fit(examples.values, codes, groups).parameters['components']
    assert SvmMaxWins(components=2, blocks=2).fit(examples.values, codes, groups).parameters['components'].shape == (
        6,
        4,
    )
    assert not ((components[:3] != 0).any(axis=0) & (components[3:] != 0).any(axis=0)).any()
    with pytest.raises(InvalidParameter, match="'blocks' of svm_max_wins is 4"):
        SvmMaxWins(blocks=4).fit(examples.values, codes, groups)


def test_one_added_slide_moves_the_planes_themselves_and_is_taken_back(make_examples):
    examples = make_examples(labels=('cork', 'felt', 'slate'))
    learner = {'texture_papers.kaboli:PassiveAggressive': {'passes': 20}}
    model = train(
        Recipe.from_mapping({'inputs': {'signal': {'features': ['hjorth']}}, 'learner': learner}, 'online'), examples
    )
    wood = make_examples(seed=2)
    rows = wood.values[wood.labels == 'wood']
    online = IncrementalClassifier(model)
    for number, values in enumerate(np.split(rows, 4)):  # four slides
        for row in values:
            online.observe(FeatureVector(0, f'{number}', 0.5, 0.25, model.names, row, feature_set=model.feature_set))
        online.observe(FeatureVector(0, f'{number}', 0.0, 0.25, last=True))
        online.add('wood', f'{number}')
    planes = np.vstack((model.parameters['planes'], np.zeros(7)))
    standard = (rows - model.parameters['mean']) / model.parameters['scale']
    for row in standard:
        move_true_and_rival(planes, row, 3, 1.0)
    expected = log_softmax(np.column_stack((standard, np.ones(len(standard)))) @ planes.T)
    np.testing.assert_allclose(online.model.predictor(rows), expected, atol=1e-12)
    assert np.mean(np.array(online.model.decide(rows)) == 'wood') > 0.9
    estimate = EvidenceAccumulator(online.model)
    vector = FeatureVector(0, 'new', 0.5, 0.25, model.names, rows[0], feature_set=model.feature_set)
    assert len(estimate.update(vector).probabilities) == len(('cork', 'felt', 'slate', 'wood'))
    online.remove('wood')
    np.testing.assert_array_equal(
        online.model.predict_log_proba(examples.values), model.predict_log_proba(examples.values)
    )
