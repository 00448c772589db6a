# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a user gets who gives `texture` the wrong thing: exit code 2 and one sentence that says what to do."""

import os
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.ros  # some sub-commands are nodes

from texture_bringup.command import main
from texture_bringup.commands.start import claim, refuse_wrong
from texture_bringup.launcher import NodeDescription, find_launch_file, read
from texture_core.config import parameters_of
from texture_core.errors import UnknownName
from texture_core.types import ExplorationState, FingerReceiver, TactileSignal
from texture_recordings.bags import BagWriter, read_bag
from texture_simulation.offline import SlidePlan, write_simulated

PLAN = SlidePlan(slides=3, speed_m_s=0.05, force_n=1.0, slide_s=1.0)


def every_second(topic, value):
    if topic != 'signal' or not isinstance(value, TactileSignal):
        return value
    return replace(value, samples=value.samples[::2], sampling_rate_hz=500.0, first_sample=value.first_sample // 2)


SOURCE = Path(__file__).parents[2]
DECLARED = re.compile(r'declare\(self, ([A-Z]\w+)')
# Bags made of that of glass: what becomes of each message; None leaves it out.
CHANGES = {
    'unlabelled': lambda _, value: replace(value, surface='') if isinstance(value, ExplorationState) else value,
    'slower': every_second,
    'vibration': lambda topic, value: None if topic == 'signal_static' else value,
}


@pytest.fixture(scope='module')
def data(tmp_path_factory):
    """Return a folder with bags 'glass' and 'leather' of simulated slides, and models trained on them."""
    folder = tmp_path_factory.mktemp('data')
    (folder / 'old.added').mkdir()
    (folder / 'old.added' / '1.json').touch()
    write_simulated(folder, PLAN, np.random.default_rng(0), surfaces=('glass', 'leather'))
    bags = [str(folder / 'glass'), str(folder / 'leather')]
    assert main(['train', 'default', *bags, '-o', str(folder / 'fast')]) == 0
    assert main(['train', 'vibration-and-taxels', *bags, '-o', str(folder / 'all')]) == 0
    os.mkfifo(folder / 'pipe')
    (folder / 'csv').mkdir()
    (folder / 'empty.yaml').touch()
    (folder / 'csv' / 'cork.csv').write_text('acc\n' + '1\n2\n' * 500)
    (folder / 'map.yaml').write_text('{label: {value: cork}, streams: {signal: {columns: [acc]}}}')
    (folder / 'mine.launch.py').write_text('from launch import LaunchDescription')
    for name, change in CHANGES.items():
        with BagWriter(folder / name) as bag:
            for topic, log_ns, value in read_bag(folder / 'glass'):
                if (new := change(topic, value)) is not None:
                    bag.write(topic, new, log_ns)
    shutil.copytree(folder / 'glass', folder / 'cut')
    (file,) = (folder / 'cut').glob('*.mcap')
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    return folder


@pytest.fixture(autouse=True)
def quiet(monkeypatch):
    """Show no progress, however busy this machine is."""
    monkeypatch.setattr('texture_core.cli.QUIET_S', 600.0)


def test_a_model_is_described_by_its_labels_and_topics(data, capsys) -> None:
    assert main(['info', str(data / 'all')]) == 0
    said = capsys.readouterr().out
    assert 'trained on 2 surfaces: glass, leather' in said
    assert 'topics: signal, signal_static' in said


def refused(arguments, capsys) -> str:
    """Return the sentence with which a command is refused."""
    assert main([str(argument) for argument in arguments]) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1, said
    return said


def test_a_second_emulator_is_refused_before_a_bag_is_made(capsys, tmp_path) -> None:
    running = FingerReceiver(str(tmp_path / 'finger'))
    launch = ['launch', 'emulator', f'devices:={tmp_path}', 'record:=true', f'bag:={tmp_path / "bag"}']
    assert 'another emulator uses the pipe' in refused(launch, capsys)
    assert not (tmp_path / 'bag').exists()
    running.close()


def test_of_two_emulators_that_start_at_once_the_second_starts_no_node(capsys, tmp_path) -> None:
    claim(tmp_path / 'finger')
    said = refused(['launch', 'emulator', f'devices:={tmp_path}'], capsys)
    assert f"another emulator, of this launch or another one, has the pipe '{tmp_path}/finger'; end that" in said


def test_emulators_in_namespaces_without_the_argument_for_their_devices_start_no_node(capsys, tmp_path) -> None:
    include = '<include file="$(find-pkg-share texture_bringup)/launch/emulator.launch.xml"/>'
    groups = [f'<group><push_ros_namespace namespace="{name}"/>{include}</group>' for name in ('left', 'right')]
    (tmp_path / 'mine.launch.xml').write_text(f'<launch>{"".join(groups)}</launch>')
    said = refused(['launch', tmp_path / 'mine.launch.xml', f'devices:={tmp_path}'], capsys)
    assert f"another emulator, of this launch or another one, has the pipe '{tmp_path}/finger'" in said
    assert 'give each of them another argument `namespace`' in said


def test_an_argument_of_a_file_that_is_not_included_now_is_accepted() -> None:
    nodes = read(find_launch_file('ros_controllers'), {'dashboard_port': '8099'}, os.environ)
    assert 'dashboard' not in [node.executable for node in nodes]


@pytest.mark.parametrize(
    ('stopped', 'number', 'code', 'sentence'),
    [
        ('launch', signal.SIGINT, 130, 'texture: interrupted'),
        ('launch', signal.SIGTERM, 130, 'texture: interrupted'),
        ('check', signal.SIGKILL, 2, 'texture: what checks the arguments has ended without an answer'),
    ],
)
def test_a_launch_that_is_stopped_while_it_checks_its_arguments_ends_and_leaves_no_process(
    stopped, number, code, sentence
) -> None:
    script = (
        'import os, sys, time; from texture_bringup import command; from texture_bringup.commands import start; '
        'start._check = lambda _: print(os.getpid(), flush=True) or time.sleep(600); sys.exit(command.program())'
    )
    given = [sys.executable, '-c', script, 'launch', 'emulator']
    with subprocess.Popen(given, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as launch:
        check = int(launch.stdout.readline())
        os.kill(check if stopped == 'check' else launch.pid, number)
        said = launch.communicate(timeout=60.0)[1].splitlines()[-1]
    assert launch.returncode == code
    assert said.startswith(sentence)
    with pytest.raises(ProcessLookupError):
        os.kill(check, 0)


@pytest.mark.parametrize('launch', ['emulator', 'ur', 'ros_controllers', 'rails', 'hand'])
@pytest.mark.parametrize(
    ('lines', 'sentence'),
    [
        ('/**/explorer: {ros__parameters: {max_forse_n: 5.0}}', "no parameter 'max_forse_n' of explorer; did you mean"),
        ('/**: {ros__parameters: {colour: red}}', "no parameter 'colour' of "),
        ('/**/explorer: {ros__parameters: {max_force_n: 77}}', 'is 77.0; allowed is 0.01 to 50.0 N'),
        ('/**/explorer: {ros__parameters: {watch_signal: 1}}', 'is 1; true or false is needed'),
        ('/**/explorer: {ros__parameters: {min_force_n: 9.0}}', "'min_force_n' is 9; it must be below 'max_force_n'"),
    ],
)
def test_a_parameter_file_is_refused_before_a_node_starts(launch, lines, sentence, capsys, tmp_path) -> None:
    (tmp_path / 'robot.yaml').write_text(f'{lines}\n')
    given = [f'devices:={tmp_path}', f'explorer_params:={tmp_path / "robot.yaml"}']
    assert sentence in refused(['launch', launch, *given], capsys)


@pytest.mark.parametrize(('model', 'recipe'), [('fast', 'default'), ('all', 'vibration-and-taxels')])
def test_a_recipe_with_the_features_of_the_model_is_allowed(model, recipe, data, tmp_path) -> None:
    given = {'devices': str(tmp_path), 'model': str(data / f'{model}.npz'), 'recipe': recipe}
    refuse_wrong(read(find_launch_file('emulator'), given, os.environ))


def test_a_parameter_of_another_arm_and_a_number_as_ros_reads_it_are_allowed(tmp_path) -> None:
    (tmp_path / 'robot.yaml').write_text(
        '/**/explorer: {ros__parameters: {twist_topic: t, approach_speed_m_s: 5e-3}}\n'
    )
    given = {'devices': str(tmp_path), 'explorer_params': str(tmp_path / 'robot.yaml')}
    refuse_wrong(read(find_launch_file('ur'), given, os.environ))


@pytest.mark.parametrize(
    'module', sorted(SOURCE.glob('texture_*/texture_*/nodes/[a-z]*.py')), ids=lambda path: path.stem
)
def test_every_parameter_that_a_node_declares_may_be_given_to_it(module) -> None:
    package, base = module.parts[-3], '_estimator' in module.stem
    text = (module.with_name('classifier.py') if base else module).read_text()
    classes = [getattr(import_module(f'{package}.nodes.{module.stem}'), name) for name in DECLARED.findall(text)]
    given = {item.name: item.default for one in classes for item in parameters_of(one) if item.name != 'finger_pipe'}
    given |= {'mapping': 'imu'} if module.stem == 'adaptor' else {}  # the messages of the default are not installed
    refuse_wrong([NodeDescription(package, module.stem, parameters=(given,))])
    with pytest.raises(UnknownName, match=f"no parameter 'colour' of {module.stem}"):
        refuse_wrong([NodeDescription(package, module.stem, parameters=({'colour': 'red'},))])


def test_the_models_are_good_and_the_figures_are_written(data, capsys, tmp_path) -> None:
    figures = tmp_path / 'figures.json'
    bags = [str(data / 'glass'), str(data / 'leather')]
    assert main(['evaluate', str(data / 'fast'), *bags, '--json', str(figures)]) == 0
    assert 'accuracy of single windows: 100.0 %' in capsys.readouterr().out
    assert '"window_accuracy": 1.0' in figures.read_text()


@pytest.mark.parametrize(
    ('command', 'sentence'),
    [
        ('evaluate fast /nowhere', "no bag '/nowhere'"),
        ('evaluate fast cut', "'cut'"),
        ('train default unlabelled -o x', 'labelled'),
        ('evaluate fast slower', '500'),
        ('evaluate all vibration', 'signal_static'),
        ('evaluate /nowhere glass', '/nowhere'),
        ('evaluate . glass', "'.' is a folder, and no name of a model"),
        ('train default glass leather -o .', "'.' is a folder, and no name of a model"),
        ('train default glass leather -o fast.json', "'fast.npz' exists; give another name"),
        ('evaluate fast glass --slides 7-9', '1 to 3'),
        ('train defualt glass -o x', "did you mean 'default'?"),
        ('train default glass -o x', 'at least two surfaces'),
        ('train roughness glass leather -o x', 'give them with --grades'),
        ('evaluate fast glass --json /proc/none/x.json', '/proc/none'),
        ('cross-validate stratified:x default glass', 'write stratified:FOLDS (2 or more)'),
        ('cross-validate stratified:5 default glass leather', 'has 3 slides, too few for 5 folds'),
        ('cross-validate folds:5 default glass', "no split 'folds'"),
        ('cross-validate leave-one-out:colour default glass', 'leave one of speed, force'),
        ('cross-validate stratified:2 default two-fingers glass leather', "has no '"),
        ('cross-validate leave-one-out:speed default glass leather', "all are of one speed, '0.05'; import or record"),
        ('train default glass leather -o fast', "'fast.npz' exists; give another name, or --force to replace it"),
        ('train default glass leather -o old', "slides were added to an earlier model, in 'old.added'; move them away"),
        ('train default glass leather -o no/x', "there is no folder 'no' for the model"),
        ('check fast', 'store that slide by `texture check fast --store`'),
        ('trian', "did you mean 'train'?"),
        ('add', 'label of the texture'),
        ('add silk --undo', 'label of the texture'),
        ('explore linear_slid', "did you mean 'linear_slide'"),
        ('explore --preset jamali --repeats -1', '--repeats is -1'),
        ('explore linear_slide --repeats 0', '--repeats is 0; 1 or more rounds are needed'),
        ('train default glass leather -o /proc/model', "'/proc/model.npz' cannot be written: No such file"),
        ('train default glass leather -o fast --recipe default', "no option of texture train '--recipe'. Known"),
        ('train --recipe default', "no option of texture train '--recipe'. Known"),
        ('check nowhere', "there is no model 'nowhere'; give the path of a trained one"),
        (
            'explore --preset ets-linear --speed 0.02 --force 0.5',
            '--speed, --force came with --preset, whose motions have',
        ),
        ('explore --preset kaboli --direction 45', '--direction came with --preset'),
        ('explore', 'give either a motion, such as linear_slide, or --preset NAME'),
        ('explore circular --preset ets-linear', "'circular' and the preset 'ets-linear' came; give either a motion"),
        ('explore linear_slide --force nan', '--force is nan; finite numbers are needed'),
        ('explore linear_slide --start 0 -inf', '--start is 0.0 -inf; finite numbers are needed'),
        ('collect a/b out', "the label 'a/b' has a slash"),
        ('collect cork out --speed 0.1 0.2', 'm lasts 0.20 s at 0.2 m/s; 0.6 s are needed to recognise it'),
        ('collect cork out --force 6 3', "'force_low_n' is 6; it must not be above 'force_high_n', 3"),
        ('collect cork fast.npz', "'fast.npz' cannot be the folder of the bags: it is a file; name another"),
        ('collect cork /proc/none', "'/proc/none' cannot be the folder of the bags: No such file or directory"),
        ('identify fast --most 0', '--most is 0'),
        ('identify /nowhere', "there is no model '/nowhere'"),
        ('identify /nowhere.npz', "there is no model '/nowhere.npz'"),
        ('identify fast', 'has no motions to choose from'),
        ('launch emulatr', "no launch file 'emulatr'; did you mean 'emulator'?"),
        ('launch emulator surfcae:=glass', "did you mean 'surface'?"),
        ('launch emulator max_force_n:=5', 'Parameters of the explorer are in the file of explorer_params:=FILE'),
        ('launch emulator surface', 'write NAME:=VALUE'),
        ('launch emulator surface:=a surface:=b', "'surface' came twice, as 'a' and as 'b'; give it once"),
        ('set emulator surface:=a surface:=b', "'surface' came twice, as 'a' and as 'b'; give it once"),
        ('launch emulator explorer_params:=csv', "'csv' is a folder; give the path of a parameter file"),
        ('launch emulator explorer_params:=empty.yaml', "parameter file 'empty.yaml' gives no parameters to a node"),
        ('launch ros_controllers preset:=moveit_serv', "did you mean 'moveit_servo'?"),
        ('launch emulator surface:=glas', "no surface 'glas'; did you mean 'glass'?"),
        ('launch emulator recipe:=defualt', "did you mean 'default'?"),
        (
            'launch emulator model:=fast recipe:=vibration-and-taxels',
            'the model was trained on signal; leave recipe:= out',
        ),
        (
            'launch emulator dashboard:=true dashboard_port:=99999',
            "'dashboard_port', node 'dashboard': parameter 'port' is",
        ),
        ('launch emulator seed:=-1', "launch argument 'seed', node 'emulator': parameter 'seed' is -1; allowed is"),
        ('launch ur emulated:=false ip:=x device:=x sensor:=tsf8', "no sensor 'tsf8'; did you mean 'tsf85'?"),
        ('launch ur sensor:=tsf8', "parameter 'sensor' is 'tsf8'; allowed is one of tsf85, "),
        ('launch emulator explorer_params:=', '$(var explorer_params) is empty; give the path of a parameter file'),
        ('launch emulator record:=true bag:=glass', "'glass' exists already; a bag is never overwritten"),
        ('launch ros_controllers mapping:=biotac_sensors', "the mapping needs 'biotac_sensors/msg/BioTacHand', which"),
        ('launch mine.launch.py', '`ros2 launch` runs'),
        ('launch emulator model:=nowhere', "there is no model 'nowhere'"),
        ('launch emulator model:=pipe', "there is no card 'pipe.json' of 'pipe'"),
        ('launch replay', 'give bag:=VALUE'),
        ('launch replay bag:=nowhere', "there is no bag 'nowhere'"),
        ('launch replay bag:=glass slides:=1000', "has slides '1000'; there are 1 to 3"),
        ('launch emulator dashboard:=maybe', "argument 'dashboard' is 'maybe'; true, false, 1 or 0 is needed"),
        ('launch ur emulated:=false ip:=x', 'auto finds the only TSF-85); give device:=VALUE'),
        ('replay glass --rate nan', "parameter 'rate' is nan; allowed is 0.01 to 1000.0"),
        ('list sensor', "did you mean 'sensors'?"),
        ('info nowhere', "there is no bag 'nowhere'"),
        ('info /', "'/' is not a bag; a folder with metadata.yaml"),
        ('info map.yaml', "'map.yaml' is no bag (a folder, or an .mcap file) and no model (.npz with .json)"),
        ('import table csv map.yaml out', "'csv' is a folder; give a mapping (YAML), and behind it the source"),
        ('import table map.yaml csv out', "'signal' has no column of time and no rate; write time: {column: NAME}"),
        ('import tabel map.yaml . out', "did you mean 'table'?"),
        ('demo --recipe defualt', "did you mean 'default'?"),
        ('dashboard --port 99999', 'allowed is 0 to 65535'),
        ('import biotac . .', 'biotac20'),
    ],
)
def test_what_is_missing_or_mistyped_is_named(command, sentence, data, capsys, monkeypatch) -> None:
    monkeypatch.chdir(data)
    monkeypatch.delenv('TEXTURE_DATA', raising=False)
    assert sentence in refused(command.split(), capsys)


def test_nodes_and_the_check_of_names_need_no_library_of_the_training() -> None:
    modules = (
        'texture_estimation.nodes.classifier, texture_features.nodes.feature_extractor, texture_evaluation.commands'
    )
    look = f"import sys, {modules}.train; print({{'scipy.stats', 'scipy.signal', 'sklearn'}} & set(sys.modules))"
    assert subprocess.run([sys.executable, '-c', look], capture_output=True, text=True, check=True).stdout == 'set()\n'


def test_a_pattern_that_takes_the_number_of_a_file_for_a_label_is_named(tmp_path, capsys) -> None:
    for start, name in enumerate(('cork_2025_1', 'cork_2026_1')):
        np.savetxt(tmp_path / f'{name}.csv', np.sin((1.0 + 0.1 * start) * np.arange(1000.0)), header='acc', comments='')
    (tmp_path / 'map.yaml').write_text(
        "{files: '{material}_{run:d}.csv', label: {column: material}, slides: {by: file}, "
        'streams: {signal: {columns: [acc], rate_hz: 1000, unit: g}}}'
    )
    words = ['import', 'table', str(tmp_path / 'map.yaml'), str(tmp_path)]
    assert 'among the files that are read; name a folder elsewhere' in refused([*words, str(tmp_path / 'out')], capsys)
    assert main([*words, '--dry-run']) == 0
    assert 'surfaces that differ by a number alone: cork_2025, cork_2026' in capsys.readouterr().out
