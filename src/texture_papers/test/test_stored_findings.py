"""What the stored experiments found at their full size: figures with intervals over seeds, and their recipes."""

import importlib
import json
from pathlib import Path

import numpy as np
import pytest

from texture_papers import report
from texture_papers.catalogue import EXPERIMENTS, PROTOCOLS
from texture_papers.protocol import (
    VERDICTS,
    Finding,
    Interval,
    MethodResult,
    PaperProtocol,
    digest_of,
    mean_over_seeds,
    verdict,
)
from texture_simulation.scene import load_scene

CHARTS = Path(__file__).parents[3] / 'docs' / 'charts'
PINNED = json.loads((Path(__file__).parent / 'stored_findings.json').read_text())
LEAST_SEEDS = 5


def numbers_of(name: str) -> dict:
    return json.loads((CHARTS / f'{name}.json').read_text())['numbers']


def test_the_findings_of_every_experiment_are_pinned() -> None:
    assert set(PINNED) == set(EXPERIMENTS)
    assert all(PINNED.values())


@pytest.mark.parametrize('name', PINNED)
def test_the_stored_findings_are_those_pinned_here(name: str) -> None:
    found = {
        finding['claim']: [*finding.get('over_seeds', finding['interval']), finding['verdict']]
        for finding in numbers_of(name)['findings']
    }
    assert found.keys() == PINNED[name].keys()
    for claim, (value, low, high, said) in PINNED[name].items():
        assert found[claim][:3] == pytest.approx([value, low, high], abs=1e-3), claim
        assert found[claim][3] == said, claim


@pytest.mark.parametrize('name', PINNED)
def test_a_verdict_follows_from_the_interval_over_at_least_five_seeds(name: str) -> None:
    numbers = numbers_of(name)
    assert len(numbers['seeds']) >= LEAST_SEEDS
    for finding in numbers['findings']:
        assert len(finding['by_seed']) >= LEAST_SEEDS, finding['claim']
        interval = mean_over_seeds(finding['by_seed'])
        assert finding['over_seeds'] == pytest.approx(interval.as_json(), abs=2e-4)
        assert finding['verdict'] == VERDICTS[verdict(Interval(*finding['over_seeds']), reaches=finding['reaches'])]


@pytest.mark.parametrize('name', PINNED)
def test_the_stored_figures_are_those_of_the_recipes_as_they_are_now(name: str) -> None:
    recipes = numbers_of(name)['recipes']
    assert recipes
    assert {recipe: digest_of(recipe) for recipe in recipes} == recipes


def guessed(protocol: PaperProtocol) -> dict[tuple[str, str], MethodResult]:
    """Return results of each method in each task by which every slide is taken for any surface."""
    rng = np.random.default_rng(0)
    results = {}
    for task in protocol.tasks:
        surfaces = task.surfaces or tuple(load_scene(protocol.scene).surfaces)
        kinds = [(code, visit.condition) for code in range(len(surfaces)) for visit in task.visits for _ in range(2)]
        codes, conditions = (np.array(column) for column in zip(*kinds, strict=True))
        for method in task.methods:
            decided = rng.integers(len(surfaces), size=(1, len(codes)))
            held_out = np.zeros(decided.shape, dtype=bool)
            results[task.name, method.name] = MethodResult(surfaces, codes, conditions, decided, held_out, 0.0)
    return results


@pytest.mark.parametrize('protocol', PROTOCOLS, ids=lambda protocol: protocol.name)
def test_the_stored_figures_of_an_anchor_stand_beside_those_of_the_paper(protocol: PaperProtocol) -> None:
    stored, anchor = numbers_of(protocol.name)['difficulty'], protocol.anchor
    assert stored['paper'] == anchor.test
    assert {task: part['paper'] for task, part in stored.get('parts', {}).items()} == anchor.parts


@pytest.mark.parametrize('protocol', PROTOCOLS, ids=lambda protocol: protocol.name)
def test_the_figure_that_set_a_scene_is_no_finding(protocol: PaperProtocol, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[MethodResult, float]] = []

    def at_least(claim: str, outcome: MethodResult, border: float) -> Finding:
        asked.append((outcome, border))
        return report.at_least(claim, outcome, border)

    module = importlib.import_module(protocol.findings.__module__)
    monkeypatch.setattr(module, 'at_least', at_least, raising=False)
    results, anchor = guessed(protocol), protocol.anchor
    assert protocol.findings(results)
    anchored = [(results.get((task, anchor.method)), test) for task, test in anchor.figures.items()]
    assert not [border for outcome, border in asked for one, test in anchored if outcome is one and border == test]
