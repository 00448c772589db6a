# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files from strangers: cut off, altered, of wrong types. Each is read or refused with one sentence, and runs no code.

Damage to bags and tables of others is in the tests of texture_recordings. FUZZ_SEED and FUZZ_TRIES look further.
"""

from __future__ import annotations

import copy
import hashlib
import io
import json
import os
import pickle
import shutil
import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from texture_bringup.launcher import all_arguments
from texture_core import config as resources
from texture_core.errors import TextureError
from texture_core.types import ExplorationState, Phase, TactileSignal
from texture_drivers.daq import load_daq
from texture_drivers.file import load_recording
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
from texture_features.feature_set import FeatureSet, LabelledFeatures
from texture_recordings.bags import BagWriter
from texture_recordings.dataset import SlideDataset
from texture_recordings.mapping import load_mapping
from texture_simulation.scene import load_scene

SEED = int(os.environ.get('FUZZ_SEED', '0'))
TRIES = int(os.environ.get('FUZZ_TRIES', '4'))  # of each kind of damage to each file; more of both to look for more
DEADLINE_S = 60  # for a single file: a reader that hangs fails
STRANGE = (
    None, True, -1, 0, 0.5, 10**9, 10**30, 1e308, -1e308, float('nan'), float('inf'), '', 'x', 'antigravity:fly',
    'numpy:zeros', 'x' * 5000, [], [[]], [None], [1e9] * 3, {}, {'x': 1}, {'': {}},
)  # fmt: skip
RATE_HZ = 1000.0


class Trap:
    """What unpickling would show: a folder is made."""

    def __init__(self, place: Path) -> None:
        self._place = place

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self._place),)


@dataclass(frozen=True)
class Reader:
    """How a good file is made in an empty folder, how it is read, and which files of it are damaged."""

    make: Callable[[Path], None]
    load: Callable[[Path], object]
    files: tuple[str, ...]


# ---- good files -----------------------------------------------------------------------------------------------------


def examples(n_surfaces: int) -> LabelledFeatures:
    rng = np.random.default_rng(0)
    labels = [f'surface {number}' for number in range(n_surfaces)]
    values = np.concatenate([np.arange(6.0) * (number + 1) + rng.normal(size=(18, 6)) for number in range(n_surfaces)])
    return LabelledFeatures(
        values=values,
        labels=np.repeat(labels, 18),
        groups=np.repeat([f'{label}/{slide}' for label in labels for slide in range(3)], 6),
        names=tuple(f'signal/f{number}' for number in range(6)),
        feature_set='abcd1234 signal=1000Hz*1',
        window_s=0.5,
        hop_s=0.25,
    )


def shipped(package: str, file: str) -> Callable[[Path], None]:
    """Return what copies a file that a package ships, under the name `good` with its ending."""
    source = resources.folder(package, str(Path(file).parent)) / Path(file).name
    return lambda folder: shutil.copy(source, folder / f'good{source.suffix}') and None


def make_model(folder: Path, recipe: str = 'default') -> None:
    model = train(load_recipe(recipe), examples(3))
    model.save(folder / 'model')
    write_added_slide(folder / 'model', 1, AddedSlide('new', 'e1', np.ones((4, 6))), model.feature_set)


def make_roughness_model(folder: Path) -> None:
    grades = Grades({f'surface {number}': 1.0 + number for number in range(4)})
    train_grades(load_roughness_recipe('roughness'), examples(4), grades).save(folder / 'model')


def messages() -> Iterator[tuple[str, Any, int]]:
    """Yield the messages of one slide of 0.6 s: topic, value, time."""
    rng = np.random.default_rng(1)
    for number in range(6):
        stamp_ns = 1_000_000_000 + number * 100_000_000
        yield (
            'exploration',
            ExplorationState(stamp_ns, 'e1', 'linear_slide', Phase.SLIDE, 0.1, 0.05, 1.0, surface='oak'),
            stamp_ns,
        )
        samples = rng.normal(size=(100, 1)).astype(np.float32)
        yield 'signal', TactileSignal(stamp_ns, 'x', ('a',), ('g',), RATE_HZ, 100 * number, samples), stamp_ns


def make_bag(folder: Path) -> None:
    with BagWriter(folder / 'bag') as bag:
        for topic, value, log_ns in messages():
            bag.write(topic, value, log_ns)


def make_recording(ending: str) -> Callable[[Path], None]:
    samples = np.random.default_rng(2).normal(size=(50, 2))

    def make(folder: Path) -> None:
        if ending == 'npz':
            np.savez_compressed(folder / 'good.npz', samples=samples, rate_hz=1000.0, channels=['a', 'b'])
        else:
            np.savetxt(folder / 'good.csv', samples, delimiter=',', header='a,b', comments='')

    return make


def read_slides(folder: Path) -> object:
    return list(SlideDataset.from_bags([folder / 'bag']).windows(FeatureSet.load('default')))


def text_file(package: str, file: str, load: Callable[[str], object]) -> Reader:
    """Return the reader of a text file, with one that a package ships for a good one."""
    name = 'good' + Path(file).suffix
    return Reader(shipped(package, file), lambda folder: load(str(folder / name)), (name,))


def recording(ending: str) -> Reader:
    name = f'good.{ending}'
    return Reader(make_recording(ending), lambda folder: load_recording(folder / name), (name,))


def model_in(folder: Path) -> object:
    return load_model(folder / 'model')


MODEL, CARD, EXAMPLE = 'model.npz', 'model.json', 'model.added/00001.json'
READERS = {
    'model': Reader(make_model, model_in, (MODEL, CARD, EXAMPLE)),
    'model of scikit-learn': Reader(lambda folder: make_model(folder, 'peaks-naive-bayes'), model_in, (MODEL,)),
    'roughness model': Reader(
        make_roughness_model, lambda folder: load_roughness_model(folder / 'model'), (MODEL, CARD)
    ),
    'bag': Reader(make_bag, read_slides, ('bag/bag.mcap', 'bag/metadata.yaml')),
    'recipe': text_file('texture_estimation', 'config/recipes/vibration-and-taxels.yaml', load_recipe),
    'scene': text_file('texture_simulation', 'config/scenes/twelve_textures.yaml', load_scene),
    'hand profile': text_file('texture_exploration', 'config/hands/leap.yaml', load_profile),
    'preset': text_file('texture_papers', 'config/presets/ets-linear.yaml', load_preset),
    'settings': text_file('texture_drivers', 'config/sensors/daq.yaml', load_daq),
    'grades': text_file('texture_papers', 'config/grades/ets_roughness.csv', read_grades),
    'launch file': text_file(
        'texture_bringup', 'launch/emulator.launch.xml', lambda path: all_arguments(Path(path), {})
    ),
    'mapping': text_file('texture_recordings', 'config/mappings/icub20.yaml', load_mapping),
    **{f'recording {ending}': recording(ending) for ending in ('csv', 'npz')},
}
CASES = [(name, file) for name, reader in READERS.items() for file in reader.files]


@pytest.fixture(scope='module')
def good(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return a folder of good files for each reader."""
    folders = {name: tmp_path_factory.mktemp('good') for name in READERS}
    for name, folder in folders.items():
        READERS[name].make(folder)
    return folders


# ---- damage ---------------------------------------------------------------------------------------------------------


def cut_off(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: rng.integers(0, len(content))]


def altered(content: bytes, rng: np.random.Generator) -> bytes:
    """Return the bytes with some of them at random."""
    changed = np.frombuffer(content, np.uint8).copy()
    places = rng.integers(0, len(changed), rng.integers(1, 9))
    changed[places] = rng.integers(0, 256, len(places))
    return changed.tobytes()


def huge_number(content: bytes, rng: np.random.Generator) -> bytes:
    """Return the bytes with a huge number at a random place: what a length or a shape is read from, with luck."""
    number = [b'\xff' * 4, b'\xff' * 8, (2**30).to_bytes(4, 'little'), (2**40).to_bytes(8, 'little'), b'999999999'][
        rng.integers(5)
    ]
    place = rng.integers(0, len(content))
    return content[:place] + number + content[place + len(number) :]


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


DAMAGE = (cut_off, altered, huge_number)


def damaged(content: bytes, file: str, rng: np.random.Generator) -> Iterator[bytes]:
    for damage in DAMAGE:
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


# ---- what must hold -------------------------------------------------------------------------------------------------


def answer(reader: Reader, folder: Path) -> bool:
    """Read; return whether it was refused, which takes one sentence, and not for ever."""

    def late(_number: int, _frame: object) -> None:
        raise AssertionError(f'no answer within {DEADLINE_S} s')

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(DEADLINE_S)
    try:
        reader.load(folder)
        return False
    except TextureError as error:
        assert str(error)
        assert '\n' not in str(error)
        return True
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize('name', READERS)
def test_good_files_are_read(name: str, good: dict[str, Path]) -> None:
    assert READERS[name].load(good[name])


@pytest.mark.parametrize(('name', 'file'), CASES)
def test_damaged_files_are_refused_with_a_sentence_or_read(
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
            answer(READERS[name], tmp_path)
        except Exception as error:
            raise AssertionError(f'{file}, damage {number}') from error


# ---- made to do harm ------------------------------------------------------------------------------------------------


def changed_card(**changes: Any) -> Callable[[Path], bytes]:
    return lambda folder: json.dumps({**json.loads((folder / CARD).read_text()), **changes}).encode()


def pickle_among_arrays(folder: Path) -> bytes:
    packed = io.BytesIO()
    np.savez(packed, **{'parameters/hidden': np.array([Trap(folder / 'trapped')], dtype=object)})
    return packed.getvalue()


def recipe(**changes: Any) -> dict[str, Any]:
    return {'inputs': {'signal': {'features': ['hjorth']}}, **changes}


# Reader, file, and what is written there: a text, or what makes it from the folder.
HARM: dict[str, tuple[str, str, str | Callable[[Path], bytes]]] = {
    'a pickle called model': ('model', MODEL, lambda folder: pickle.dumps(Trap(folder / 'trapped'))),
    'a pickle among the arrays': ('model', MODEL, pickle_among_arrays),
    'a deep card': ('model', CARD, '{"format": 1, "recipe": {"inputs": ' + '[' * 900 + ']' * 900 + '}}'),
    'a card that names a program': ('model', CARD, changed_card(recipe=recipe(learner='antigravity:fly'))),
    'an added slide as deep as can be': ('model', EXAMPLE, '{"values": ' + '[' * 100_000),
}


@pytest.mark.parametrize('what', HARM)
def test_what_is_made_to_do_harm_is_refused_and_runs_nothing(
    what: str, good: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, file, harm = HARM[what]
    shutil.copytree(good[name], tmp_path, dirs_exist_ok=True)
    (tmp_path / file).write_bytes(harm.encode() if isinstance(harm, str) else harm(tmp_path))
    if file == MODEL:
        sealed(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert answer(READERS[name], tmp_path)
    assert not (tmp_path / 'trapped').exists()


@pytest.mark.parametrize(('name', 'file'), CASES)
def test_a_pipe_is_refused_at_once(name: str, file: str, good: dict[str, Path], tmp_path: Path) -> None:
    shutil.copytree(good[name], tmp_path, dirs_exist_ok=True)
    (tmp_path / file).unlink()
    os.mkfifo(tmp_path / file)
    # A folder without metadata stands for the bags in it.
    assert answer(READERS[name], tmp_path) or file == 'bag/metadata.yaml'
