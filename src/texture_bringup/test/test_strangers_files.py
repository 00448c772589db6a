# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Models and settings from strangers: damaged or altered, each is read or refused with one sentence, and runs no code.

Damage to bags, tables and recordings is in the tests of the packages that read them. FUZZ_SEED and FUZZ_TRIES look
further.
"""

from __future__ import annotations

import copy
import hashlib
import io
import json
import os
import pickle
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from foreign_tables import MAPPING

from texture_bringup.launcher import read
from texture_core import config as resources
from texture_core.errors import TextureError
from texture_drivers.daq import load_daq
from texture_estimation.model import AddedSlide, load_model, write_added_slide
from texture_estimation.recipe import load_recipe
from texture_estimation.roughness import (
    Grades,
    load_roughness_model,
    load_roughness_recipe,
    read_grades,
    train_grades,
)
from texture_estimation.training import train
from texture_exploration.arms.hand import load_profile
from texture_exploration.presets import load_preset
from texture_features.feature_set import LabelledFeatures
from texture_recordings.mapping import load_mapping
from texture_simulation.scene import load_scene

SEED = int(os.environ.get('FUZZ_SEED', '0'))
TRIES = int(os.environ.get('FUZZ_TRIES', '4'))  # of each kind of damage to each file; more of both to look for more
STRANGE = (
    None, True, -1, 0, 0.5, 10**9, 10**30, 1e308, -1e308, float('nan'), float('inf'), '', 'x', 'antigravity:fly',
    'numpy:zeros', 'x' * 5000, [], [[]], [None], [1e9] * 3, {}, {'x': 1}, {'': {}},
)  # fmt: skip
MODEL, CARD, EXAMPLE = 'model.npz', 'model.json', 'model.added/00001.json'


def examples(n_surfaces: int) -> LabelledFeatures:
    rng = np.random.default_rng(0)
    labels = [f'surface {number}' for number in range(n_surfaces)]
    values = np.concatenate([np.arange(6.0) * (number + 1) + rng.normal(size=(18, 6)) for number in range(n_surfaces)])
    groups = np.repeat([f'{label}/{slide}' for label in labels for slide in range(3)], 6)
    names = tuple(f'signal/f{number}' for number in range(6))
    return LabelledFeatures(values, np.repeat(labels, 18), groups, names, 'abcd1234 signal=1000Hz*1', 0.5, 0.25)


def make_model(folder: Path, recipe: str) -> None:
    model = train(load_recipe(recipe), examples(3))
    model.save(folder / 'model')
    write_added_slide(folder / 'model', 1, AddedSlide('new', 'e1', np.ones((4, 6))), model.feature_set)


def make_roughness_model(folder: Path) -> None:
    grades = Grades({f'surface {number}': 1.0 + number for number in range(4)})
    train_grades(load_roughness_recipe('roughness'), examples(4), grades).save(folder / 'model')


# How a good file is made in a folder, how it is read, and which files of it are damaged.
Reader = tuple[Callable[[Path], object], Callable[[Path], object], tuple[str, ...]]


def text_file(package: str, file: str, load: Callable[[str], object]) -> Reader:
    """Return the reader of a text file, with one that a package ships for a good one."""
    source = resources.folder(package, str(Path(file).parent)) / Path(file).name
    name = f'good{source.suffix}'
    return lambda folder: shutil.copy(source, folder / name), lambda folder: load(str(folder / name)), (name,)


def model_of(recipe: str, *files: str) -> Reader:
    return lambda folder: make_model(folder, recipe), lambda folder: load_model(folder / 'model'), files


READERS: dict[str, Reader] = {
    'model': model_of('default', MODEL, CARD, EXAMPLE),
    'model of scikit-learn': model_of('peaks-naive-bayes', MODEL),
    'roughness model': (make_roughness_model, lambda folder: load_roughness_model(folder / 'model'), (MODEL, CARD)),
    'recipe': text_file('texture_estimation', 'config/recipes/vibration-and-taxels.yaml', load_recipe),
    'scene': text_file('texture_simulation', 'config/scenes/twelve_textures.yaml', load_scene),
    'hand profile': text_file('texture_exploration', 'config/hands/leap.yaml', load_profile),
    'preset': text_file('texture_papers', 'config/presets/ets-linear.yaml', load_preset),
    'settings': text_file('texture_drivers', 'config/sensors/daq.yaml', load_daq),
    'grades': text_file('texture_papers', 'config/grades/ets_roughness.csv', read_grades),
    'mapping': (
        lambda folder: (folder / 'good.yaml').write_text(MAPPING),
        lambda folder: load_mapping(folder / 'good.yaml'),
        ('good.yaml',),
    ),
    'launch file': text_file('texture_bringup', 'launch/emulator.launch.xml', lambda path: read(Path(path), {}, {})),
}
CASES = [(name, file) for name, (_, _, files) in READERS.items() for file in files]


@pytest.fixture(scope='module')
def good(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return a folder of good files for each reader."""
    folders = {name: tmp_path_factory.mktemp('good') for name in READERS}
    for name, (make, load, _) in READERS.items():
        make(folders[name])
        assert load(folders[name])
    return folders


def cut_off(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: rng.integers(0, len(content))]


def altered(content: bytes, rng: np.random.Generator) -> bytes:
    """Return the bytes with some of them at random."""
    changed = np.frombuffer(content, np.uint8).copy()
    places = rng.integers(0, len(changed), rng.integers(1, 9))
    changed[places] = rng.integers(0, 256, len(places))
    return changed.tobytes()


def novel(content: bytes, rng: np.random.Generator, ending: str) -> bytes:
    """Return the text with one value in it, at any depth, replaced by a strange one or left out."""
    dump = json.dumps if ending == 'json' else yaml.safe_dump
    value = copy.deepcopy(json.loads(content) if ending == 'json' else yaml.safe_load(content))
    places = list(within(value))
    place, key = places[rng.integers(len(places))]
    if rng.random() < 0.2:
        del place[key]
    else:
        place[key] = STRANGE[rng.integers(len(STRANGE))]
    return dump(value).encode()


def within(value: Any) -> Iterator[tuple[Any, Any]]:
    """Yield the container and the key of everything in a value."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield value, key
        yield from within(inner)


def damaged(content: bytes, file: str, rng: np.random.Generator) -> Iterator[bytes]:
    for damage in (cut_off, altered):
        for _ in range(TRIES):
            yield damage(content, rng)
    ending = file.rpartition('.')[2]
    if ending in ('json', 'yaml'):
        for _ in range(4 * TRIES):
            yield novel(content, rng, ending)


def sealed(folder: Path) -> None:
    """Let the card of a model vouch for the file beside it, as anybody can."""
    card, parts = folder / 'model.json', folder / 'model.npz'
    if parts.exists():
        digest = hashlib.sha256(parts.read_bytes()).hexdigest()
        text = card.read_bytes().partition(b'"sha256": "')
        card.write_bytes(text[0] + text[1] + digest.encode() + text[2][64:])


def refused(name: str, folder: Path) -> bool:
    """Read; return whether it was refused, which takes one sentence."""
    try:
        READERS[name][1](folder)
        return False
    except TextureError as error:
        assert str(error)
        assert '\n' not in str(error)
        return True


@pytest.mark.parametrize(('name', 'file'), CASES)
def test_damaged_files_and_a_pipe_are_refused_with_a_sentence_or_read(
    name: str, file: str, good: dict[str, Path], tmp_path: Path
) -> None:
    shutil.copytree(good[name], tmp_path, dirs_exist_ok=True)
    content = (good[name] / file).read_bytes()
    for number, bad in enumerate(damaged(content, file, np.random.default_rng(SEED))):
        (tmp_path / file).write_bytes(bad)
        if file == MODEL:
            shutil.copy(good[name] / CARD, tmp_path / CARD)
            sealed(tmp_path)
        try:
            refused(name, tmp_path)
        except Exception as error:
            raise AssertionError(f'{file}, damage {number}') from error
    (tmp_path / file).unlink()
    os.mkfifo(tmp_path / file)
    assert refused(name, tmp_path)


class Trap:
    """What unpickling would show: a folder is made."""

    def __init__(self, place: Path) -> None:
        self._place = place

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self._place),)


def pickle_among_arrays(folder: Path) -> bytes:
    packed = io.BytesIO()
    np.savez(packed, **{'parameters/hidden': np.array([Trap(folder / 'trapped')], dtype=object)})
    return packed.getvalue()


def card_that_names_a_program(folder: Path) -> bytes:
    recipe = {'inputs': {'signal': {'features': ['hjorth']}}, 'learner': 'antigravity:fly'}
    return json.dumps({**json.loads((folder / CARD).read_text()), 'recipe': recipe}).encode()


# File of the model, and what is written there.
HARM: dict[str, tuple[str, Callable[[Path], bytes]]] = {
    'a pickle called model': (MODEL, lambda folder: pickle.dumps(Trap(folder / 'trapped'))),
    'a pickle among the arrays': (MODEL, pickle_among_arrays),
    'a deep card': (CARD, lambda _: b'{"format": 2, "recipe": {"inputs": ' + b'[' * 900 + b']' * 900 + b'}}'),
    'a card that names a program': (CARD, card_that_names_a_program),
    'an added slide as deep as can be': (EXAMPLE, lambda _: b'{"values": ' + b'[' * 100_000),
}


@pytest.mark.parametrize('what', HARM)
def test_what_is_made_to_do_harm_is_refused_and_runs_nothing(
    what: str, good: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, harm = HARM[what]
    shutil.copytree(good['model'], tmp_path, dirs_exist_ok=True)
    (tmp_path / file).write_bytes(harm(tmp_path))
    if file == MODEL:
        sealed(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert refused('model', tmp_path)
    assert not (tmp_path / 'trapped').exists()
