# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The golden set: results of recipes on fixed slides, and what arms are sent, so that refactoring changes none.

`python tools/golden.py --check` computes all rows anew and compares them with `golden.json`; `--write` stores them.
`--only WORD` takes the rows whose name contains the word, in both uses. A row is a recipe on a source of slides: a
scene, simulated with a fixed seed, or a public data set (in TEXTURE_DATA or ../shared/data; its rows are left out where
it is absent). It holds digests of features, log-probabilities of the first windows and their mean over all, and the
final estimate of slides that were not trained. What is learnt is seen through these answers alone, as learners will be
replaced: a recipe whose pairs only vote, such as ets-linear-svm, shows a change once a vote changes.

A row 'arms: NAME' holds the phases of one exploration and what was sent to the arm or hand, thinned; where only real
time exists, the kinds of commands on the wire.

A difference is explained or fixed, never re-recorded without a reason: the commit that writes `golden.json` names the
changed rows, and why.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import math
import os
import struct
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.types import ExplorationRequest

# All imports of the golden set from the suite: after a move only these lines change.
from texture_estimation.recipe import load_recipe
from texture_estimation.roughness import RoughnessAccumulator, load_roughness_recipe, read_grades, train_grades
from texture_estimation.training import train
from texture_evaluation.evaluate import run_model
from texture_evaluation.train import training_examples
from texture_exploration.arms.in_hand import InHandArm, InHandParams
from texture_exploration.arms.rails import RailsArm, RailsParams
from texture_exploration.arms.simulated import SimulatedArm
from texture_exploration.explorer import Explorer
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams
from texture_recordings.dataset import SlideDataset
from texture_recordings.public_sets import IMPORTS
from texture_simulation.devices import dynamixel, rails
from texture_simulation.offline import SlidePlan, write_simulated

ROOT = Path(__file__).resolve().parents[1]
STORED = ROOT / 'tools' / 'golden.json'
DATA = Path(os.environ.get('TEXTURE_DATA') or ROOT.parent / 'shared' / 'data')

SEED = 20
TRAINED, TESTED = '1-6', '7'
DIGITS, TOLERANCE = 7, 1e-6  # so that other versions of numpy and other processors agree
# Recipes whose numbers depend on the processor: tolerance of features, and of what is learnt. Measured with the BLAS
# kernels SkylakeX, Haswell and Nehalem; on one machine all agree within TOLERANCE, which `--strict` demands.
LOOSE = {
    # Cell means that are equal but for rounding are ranked by it, so Spearman's correlation moves by up to 8e-4.
    'kaboli-*': (1e-3, 1e-3),
    # Hundreds of training steps in single precision: probabilities move by up to 2e-3.
    **dict.fromkeys(('default', 'two-fingers', 'vibration-and-taxels'), (TOLERANCE, 1e-2)),
    # On one simulated channel its log-probabilities of -80 move by 2e-4 of themselves; the cause was not traced.
    'any-speed': (TOLERANCE, 1e-3),
    # Levenberg-Marquardt steps: grades move by up to 7e-6.
    'ets-roughness-ann1*': (TOLERANCE, 1e-4),
}
SHOWN_WINDOWS = 3
DIGEST = 6
SMALLEST = 1e-9  # features below it do not count in a digest


@dataclass(frozen=True)
class GoldenSlides:
    """Slides over a few surfaces: of a scene, or of a public data set where `data_set` names one."""

    recipes: tuple[str, ...]  # names; '*' matches anything
    surfaces: tuple[str, ...]
    scene: str = ''
    plan: SlidePlan | None = None
    data_set: str = ''


def _plan(speed_m_s: float, force_n: float, slide_s: float, fingers: int = 1) -> SlidePlan:
    return SlidePlan(7, speed_m_s, force_n, slide_s, fingers=fingers)


SOURCES = {
    'twelve_textures': GoldenSlides(
        ('any-place', 'any-place-and-taxels', 'default', 'peaks-naive-bayes', 'any-speed', 'vibration-and-taxels'),
        ('glass', 'brushed_metal', 'ridge_1mm', 'ridge_3mm'),
        'twelve_textures',
        _plan(0.1, 2.0, 1.5),
    ),
    'two fingers': GoldenSlides(
        ('two-fingers',),
        ('glass', 'brushed_metal', 'ridge_1mm', 'ridge_3mm'),
        'twelve_textures',
        _plan(0.1, 2.0, 1.5, 2),
    ),
    'ets_linear': GoldenSlides(
        ('ets-linear-*',), ('ridge_1', 'ridge_2a', 'ridge_2b', 'grid_1'), 'ets_linear', _plan(0.15, 2.0, 1.2)
    ),
    'ets_circular': GoldenSlides(
        ('ets-circular-*',), ('ridge_1', 'ridge_2', 'grid_2', 'circles'), 'ets_circular', _plan(0.15, 2.0, 1.2)
    ),
    'ets_fine': GoldenSlides(
        ('ets-fine-*',),
        ('sheet_metal', 'smooth_plastic', 'sheet_of_paper', 'cardboard_paper'),
        'ets_fine',
        _plan(0.15, 2.0, 1.5),
    ),
    'jamali': GoldenSlides(
        ('jamali-*',), ('carpet_1', 'sponge_1', 'tile_1', 'vinyl_1'), 'jamali', _plan(0.05, 2.0, 2.2)
    ),
    'hu': GoldenSlides(('hu-pca-*',), ('linen_1', 'linen_2', 'linen_3', 'linen_5'), 'hu', _plan(0.0255, 1.5, 3.2)),
    'kaboli': GoldenSlides(
        ('kaboli-em', 'kaboli-pa', 'kaboli-svm', 'vibration-and-taxels'),
        ('red_ball', 'rough_ball', 'orange', 'sponge_ball'),
        'kaboli',
        _plan(0.02, 0.7, 2.4),
    ),
    'two kaboli fingers': GoldenSlides(
        ('kaboli-*-two-fingers',),
        ('red_ball', 'rough_ball', 'orange', 'sponge_ball'),
        'kaboli',
        _plan(0.02, 0.7, 2.4, 2),
    ),
    'shapes': GoldenSlides(
        ('kaboli-svm',), ('red_ball', 'rough_ball', 'orange', 'apple'), 'kaboli_shapes', _plan(0.02, 0.7, 2.4)
    ),
    'oriented': GoldenSlides(
        ('default',), ('ridges_x', 'ridges_y', 'ridges_left', 'cloth_even'), 'oriented', _plan(0.1, 2.0, 1.5)
    ),
    'sticky': GoldenSlides(
        ('friction-svm',), ('dry_glass', 'polished_plastic', 'lacquer', 'rubber'), 'sticky', _plan(0.1, 1.0, 1.5)
    ),
    'roughness': GoldenSlides(
        ('ets-roughness-*', 'roughness'),
        ('k_paper', 'a_composite_wood', 'b_grip_plastic', 'j_grip_plastic', 'e_sandpaper'),
        'roughness',
        _plan(0.15, 2.0, 1.5),
    ),
    'biotac20': GoldenSlides(
        ('default', 'peaks-naive-bayes', 'vibration-and-taxels', 'taxels-any-day', 'kaboli-em', 'kaboli-svm'),
        ('material02', 'material05', 'material09', 'material14'),
        data_set='biotac20',
    ),
    'ntp21': GoldenSlides(('any-speed',), ('texture01', 'texture05', 'texture13', 'texture24'), data_set='ntp21'),
}


def digest(values: np.ndarray) -> list[float]:
    """Return a fixed projection of a vector to a few numbers, in which features of any magnitude count."""
    # Weights by formula: streams of random numbers may differ between versions of numpy.
    places = np.outer(np.arange(1, DIGEST + 1), np.arange(1, len(values) + 1))
    weights = np.cos(math.sqrt(2.0) * places + places**2 % 17)
    return rounded(weights @ np.arcsinh(np.asarray(values, dtype=np.float64) / SMALLEST))


def rounded(value: Any) -> Any:
    """Return numbers with seven significant digits, in the form of JSON; NaN becomes None."""
    if isinstance(value, Mapping):
        return {name: rounded(item) for name, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [rounded(item) for item in value]
    if isinstance(value, (float, np.floating)):
        return float(f'{value:.{DIGITS}g}') if math.isfinite(value) else None
    return value


def differences(stored: Any, found: Any, where: str = '', strict: bool = False) -> Iterator[str]:
    """Yield one line for each place where two values in the form of JSON differ, numbers by more than the tolerance."""
    if isinstance(stored, dict) and isinstance(found, dict):
        for name in sorted({*stored, *found}):
            yield from differences(stored.get(name), found.get(name), f'{where}/{name}', strict)
    elif isinstance(stored, list) and isinstance(found, list) and len(stored) == len(found):
        for number, pair in enumerate(zip(stored, found, strict=True)):
            yield from differences(*pair, f'{where}/{number}', strict)
    elif isinstance(stored, float) and isinstance(found, (int, float)):
        tolerance = TOLERANCE if strict else _tolerance(where)
        if not math.isclose(stored, found, rel_tol=tolerance, abs_tol=tolerance):
            yield f'{where}: stored {stored}, found {found}'
    elif stored != found:
        yield f'{where}: stored {stored}, found {found}'


def _tolerance(where: str) -> float:
    recipe = where.strip('/').partition(' on ')[0]
    of_features, of_learnt = next((loose for name, loose in LOOSE.items() if fnmatch(recipe, name)), (TOLERANCE,) * 2)
    return of_features if '/features/' in where else of_learnt


def names(only: str = '') -> list[str]:
    """Return the names of the rows that can be computed here, or of those that contain a word."""
    found = [name for name in ARMS if arm_available(name)]
    for name, source in SOURCES.items():
        if available(source):
            found += [f'{recipe} on {name}' for recipe in _recipes(source)]
    return [name for name in found if only in name]


def rows(only: str = '') -> dict[str, Any]:
    """Return all rows, or those whose name contains a word; without those of absent data."""
    wanted = names(only)
    found: dict[str, Any] = {name: ARMS[name](Recording()) for name in wanted if name in ARMS}
    for name, source in SOURCES.items():
        recipes = [recipe for recipe in _recipes(source) if f'{recipe} on {name}' in wanted]
        if not recipes:
            continue
        with tempfile.TemporaryDirectory() as folder:
            bags = _bags(source, Path(folder))
            for recipe in recipes:
                ask = _graded if every_recipe()[recipe] == 'roughness' else _recognised
                found[f'{recipe} on {name}'] = ask(recipe, bags)
    return found


def available(source: GoldenSlides) -> bool:
    """Return whether the slides of a source can be had here."""
    return not source.data_set or (DATA / source.data_set).is_dir()


def every_recipe() -> dict[str, str]:
    """Return all shipped recipes in the order of their names, with their kind: 'recipes' or 'roughness'."""
    files = sorted(ROOT.glob('src/*/config/recipes/*.yaml')) + sorted(ROOT.glob('src/*/config/roughness/*.yaml'))
    return {path.stem: path.parent.name for path in sorted(files, key=lambda path: path.stem)}


def _recipes(source: GoldenSlides) -> list[str]:
    return [name for name in every_recipe() if any(fnmatch(name, wanted) for wanted in source.recipes)]


def _bags(source: GoldenSlides, folder: Path) -> list[Path]:
    """Write the bags of a source; a second set along y lies in a separate folder."""
    if source.data_set:
        IMPORTS[source.data_set](DATA / source.data_set, folder / 'x', '1-7', source.surfaces)
    else:
        rng = np.random.default_rng(SEED)
        write_simulated(folder / 'x', source.plan, rng, source.scene, source.surfaces)
        if source.scene == 'hu':
            along_y = replace(source.plan, direction_rad=math.pi / 2)
            write_simulated(folder / 'y', along_y, rng, source.scene, source.surfaces)
    return sorted(folder.iterdir())


def _dataset(bags: Sequence[Path], slides: str, topics: Sequence[str], crossed: bool) -> SlideDataset:
    """Read slides; where both axes are wanted, those along x and along y as two parts of one exploration."""
    along_x = SlideDataset.from_bags(bags[:1], slides, None, topics)
    if not crossed:
        return along_x
    joined = []
    for x, y in zip(along_x, SlideDataset.from_bags(bags[1:], slides, None, topics), strict=True):
        later_ns = x.states[-1].stamp_ns + 1_000_000_000 - y.states[0].stamp_ns
        # The finger turns without being lifted: phases between the two slides would end the first.
        turned = [
            replace(state, stamp_ns=state.stamp_ns + later_ns, exploration_id=x.exploration_id)
            for state in y.states[2:]
        ]
        states = [*x.states[:-2], *turned]
        signals = {}
        for topic, batches in x.signals.items():
            more = y.signals[topic]
            # As many samples are missing between the parts as the clock shows.
            end, gap_ns = batches[-1], more[0].stamp_ns + later_ns - batches[-1].end_ns
            shift = end.next_sample + round(gap_ns * 1e-9 * end.sampling_rate_hz) - more[0].first_sample
            signals[topic] = (
                *batches,
                *(replace(b, stamp_ns=b.stamp_ns + later_ns, first_sample=b.first_sample + shift) for b in more),
            )
        joined.append(replace(x, states=tuple(states), signals=signals))
    return SlideDataset(tuple(joined))


def _recognised(name: str, bags: Sequence[Path]) -> dict[str, Any]:
    """Return what a recipe learns, and its estimates of slides that were not trained."""
    recipe = load_recipe(name)
    crossed = any('@' in topic for topic in recipe.as_mapping()['inputs'])
    topics = recipe.feature_set.topics
    model = train(recipe, training_examples(recipe, _dataset(bags, TRAINED, topics, crossed)), name)
    results = {}
    for slide, events in _dataset(bags, TESTED, topics, crossed).windows(recipe.feature_set):
        vectors, estimates, _ = run_model(model, events)
        windows = [vector for vector in vectors if not vector.last]
        logs = model.predict_log_proba(np.stack([vector.values for vector in windows]))
        final = estimates[-1]
        results[slide.surface] = {
            'windows': len(windows),
            'features': [digest(vector.values) for vector in windows[:SHOWN_WINDOWS]],
            # Logarithms: the probabilities of a certain window are all 1 or 0 but for the last digits.
            'log_probabilities': rounded([*logs[:SHOWN_WINDOWS], logs.mean(axis=0)]),
            'final': rounded(
                {
                    'label': final.label,
                    'accepted': final.accepted,
                    'decided': final.decided,
                    'confidence': final.confidence,
                    'probabilities': final.probabilities,
                    'prediction_set': final.prediction_set,
                }
            ),
        }
    return {
        'feature_set': model.feature_set,
        'features': len(model.names),
        'exponent': rounded(float(model.tempering_exponent)),
        'slides': results,
    }


def _graded(name: str, bags: Sequence[Path]) -> dict[str, Any]:
    """Return what a roughness recipe learns from the shipped grades, and how it grades slides it has not seen."""
    recipe = load_roughness_recipe(name)
    cut = replace(recipe.feature_set, windows=recipe.training_windows)
    examples = SlideDataset.from_bags(bags, TRAINED, None, cut.topics).features(cut)
    model = train_grades(recipe, examples, read_grades('ets_roughness'), name)
    results = {}
    for slide, vectors in SlideDataset.from_bags(bags, TESTED, None, cut.topics).vectors(recipe.feature_set):
        accumulator, estimate = RoughnessAccumulator(model), None
        for vector in vectors:
            estimate = accumulator.update(vector) or estimate
        windows = np.stack([vector.values for vector in vectors if not vector.last][:SHOWN_WINDOWS])
        results[slide.surface] = {
            'features': [digest(values) for values in windows],
            'grades': rounded([np.asarray(part) for part in model.grade(windows)]),
            'final': estimate
            and rounded({'grade': estimate.grade, 'std': estimate.grade_std, 'valid': estimate.valid}),
        }
    return {'feature_set': model.feature_set, 'features': len(model.names), 'slides': results}


SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=2.0, distance_m=0.03)
RUB = ExplorationRequest('in_hand_sliding', speed_m_s=0.02, duration_s=1.5)
SHOWN_COMMANDS, SHOWN_CHANGE = 60, 5e-4  # m/s, N
PATIENCE_S = 40.0
sys.path.append(str(ROOT / 'src' / 'texture_exploration' / 'test'))  # whose tests step arms, and time, by hand


class Recording:
    """What was sent during one exploration, and how much of it when each phase began."""

    def __init__(self) -> None:
        self.sent: list[Any] = []
        self.phases: list[list[Any]] = []

    def note(self, state: Any) -> None:
        """Take a state of the exploration."""
        if not self.phases or self.phases[-1][0] != state.phase.value:
            self.phases.append([state.phase.value, len(self.sent)])

    def listen(self, owner: Any, method: str, row: Callable[..., Any]) -> None:
        """Note each call of a method, as `row` shows it."""
        call = getattr(owner, method)
        setattr(owner, method, lambda *given: (self.sent.append(row(*given)), call(*given))[1])

    def stepped(self, arm: Any, clock: Callable[[], int], pace: Callable[[], None]) -> dict[str, Any]:
        """Explore in simulated time; return phases and thinned commands."""
        explorer = Explorer(arm, TouchParams(), SafetyLimits(approach_timeout_s=30.0), self.note, clock)
        outcome = explorer._prepare('golden', SLIDE if not isinstance(arm, InHandArm) else RUB).run(pace)
        changes, newest = [], {}
        for index, row in enumerate(self.sent):
            kind = row[0] if isinstance(row[0], str) else ''
            if kind not in newest or _changes(newest[kind], row):
                newest[kind] = row
                changes.append([index, row])
        shown = np.linspace(0, len(changes) - 1, min(SHOWN_COMMANDS, len(changes))).round().astype(int)
        return {
            'outcome': [outcome.success, outcome.message],
            'phases': self.phases,
            'sent': rounded([changes[index] for index in shown]),
        }

    def in_real_time(self, arm: Any, request: ExplorationRequest) -> dict[str, Any]:
        """Explore against the clock; return the phases, and the kinds of what was sent in the order they began."""
        # How well the arm follows is no matter here, and depends on how busy the machine is.
        touch = TouchParams(speed_tolerance=0.3, force_tolerance=0.3, peak_speed_fraction=3.0, peak_force_fraction=3.0)
        explorer = Explorer(arm, touch, SafetyLimits(state_timeout_s=1.0), self.note)
        try:
            explorer.connect()
            exploration = explorer.begin('golden', request)
            assert exploration.ended.wait(PATIENCE_S)
        finally:
            explorer.close()
        count = -1
        while count < (count := len(self.sent)):  # a busy device executes the last ones later
            time.sleep(0.2)
        return {
            'outcome': [exploration.outcome.success, exploration.outcome.message],
            'phases': [phase for phase, _ in self.phases],
            'kinds': list(dict.fromkeys(self.sent)),
        }


def _changes(before: Sequence[Any], row: Sequence[Any]) -> bool:
    """Return whether a command is more than the noise of force control away from the one shown before it."""
    pairs = [(a, b) for a, b in zip(before, row, strict=True) if a != b]
    return any(None in pair or abs(pair[0] - pair[1]) > SHOWN_CHANGE for pair in pairs)


def _command(command: Any) -> list[Any]:
    return [*command.tangential_m_s, command.normal_m_s, command.force_n]


class _Clock:
    """Time of simulated fingers: it passes by steps."""

    now_ns = 1_000_000_000

    def __call__(self) -> int:
        return self.now_ns

    def pace(self, device: Any) -> None:
        for _ in range(2):
            self.now_ns += 5_000_000
            device.step(0.005)


def _simulated(recording: Recording) -> dict[str, Any]:
    clock = _Clock()
    arm = SimulatedArm(clock=clock, own_thread=False)
    recording.listen(arm, 'command', _command)
    return recording.stepped(arm, clock, lambda: clock.pace(arm))


def _ros_controllers(recording: Recording) -> dict[str, Any]:
    harness = importlib.import_module('twist_robot')
    robot = harness.Robot(harness.TwistControllerParams(jitter_s=0.0))
    recording.listen(robot, 'send_velocity', list)
    return recording.stepped(robot.arm, lambda: robot.now_ns, lambda: robot.pass_time(0.01))


def _ur(recording: Recording) -> dict[str, Any]:
    link = importlib.import_module('test_ur_command_stream').SteppedLink(recording.sent)
    return recording.stepped(link.arm, lambda: link.now_ns, link.pace)


def _rails(recording: Recording) -> dict[str, Any]:
    def kind(order: int, body: bytes) -> str:
        if order != 0xA0:
            return {0xA1: 'stop', 0xA2: 'clear'}[order]
        vx, vy, mode, value = struct.unpack('<iiBi', body)
        return ('hold', 'rise' if value > 0 else 'fall', 'press')[mode] + (' and slide' if vx or vy else '')

    with tempfile.TemporaryDirectory() as folder, rails.EmulatedRails(Path(folder) / 'rails') as device:
        recording.listen(device.firmware, '_execute', kind)
        return recording.in_real_time(RailsArm(RailsParams(device=str(device.port.link))), SLIDE)


def _dynamixel(recording: Recording) -> dict[str, Any]:
    goals = {address for places in dynamixel.GOALS for address in places}

    def kind(motor: int, instruction: int, params: bytes) -> str:
        name = {1: 'ping', 2: 'read', 3: 'write', 8: 'reboot', 0x82: 'read of all', 0x83: 'write of all'}[instruction]
        address = int.from_bytes(params[:2], 'little')
        value = f' = {int.from_bytes(params[2:], "little")}' if instruction == 3 and address not in goals else ''
        return f'{name} {address}{value}' if params else name

    motors = dynamixel.leap_hand()
    with tempfile.TemporaryDirectory() as folder, dynamixel.EmulatedDynamixelBus(Path(folder) / 'bus', motors) as bus:
        recording.listen(bus, '_execute', kind)
        params = InHandParams(device=str(bus.port.link), grip_timeout_s=20.0)
        return recording.in_real_time(InHandArm(params), RUB)


ARMS: Mapping[str, Callable[[Recording], dict[str, Any]]] = {
    'arms: simulated': _simulated,
    'arms: ur': _ur,
    'arms: ros_controllers': _ros_controllers,
    'arms: rails': _rails,
    'arms: dynamixel': _dynamixel,
}
REAL_TIME = ('arms: rails', 'arms: dynamixel')


def arm_available(name: str) -> bool:
    """Return whether what an arm is driven with is installed."""
    return name != 'arms: dynamixel' or importlib.util.find_spec('dynamixel_sdk') is not None


def stored_rows() -> dict[str, Any]:
    """Return what is stored."""
    stored: dict[str, Any] = json.loads(STORED.read_text()) if STORED.exists() else {}
    return stored


def check(only: str = '', strict: bool = False) -> list[str]:
    """Return one line for each difference from the stored rows that can be computed here."""
    stored = stored_rows()
    return list(differences({name: stored.get(name) for name in names(only)}, rows(only), strict=strict))


def main() -> int:
    """Write or check, as the command line requests."""
    parser = argparse.ArgumentParser(description='the golden set of the suite')
    use = parser.add_mutually_exclusive_group(required=True)
    use.add_argument('--write', action='store_true', help='store the rows; explain every change in the commit')
    use.add_argument('--check', action='store_true', help='compare with the stored rows')
    parser.add_argument('--only', default='', metavar='WORD', help='only rows whose name contains it')
    parser.add_argument('--strict', action='store_true', help='on the machine that stored them: no looser recipes')
    options = parser.parse_args()
    here, stored = names(options.only), stored_rows()
    if not here:
        print(
            f"golden: no row that can be computed here has '{options.only}' in its name; "
            "write a part of one, such as 'default on oriented', and add a new recipe to SOURCES",
            file=sys.stderr,
        )
        return 2
    if options.check:
        lines = check(options.only, options.strict)
        left_out = [name for name in stored if options.only in name and name not in here]
        print('\n'.join([*lines, f'{len(lines)} differences in {len(here)} rows']))
        print(f'not compared, as data or a library is missing here: {", ".join(left_out) or "none"}')
        return bool(lines)
    found = {**{name: row for name, row in stored.items() if name not in here}, **rows(options.only)}
    lines = [f'{json.dumps(name)}: {json.dumps(row)}' for name, row in sorted(found.items())]
    STORED.write_text('{\n' + ',\n'.join(lines) + '\n}\n')
    return 0


if __name__ == '__main__':
    sys.exit(main())
