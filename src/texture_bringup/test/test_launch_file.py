# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import os
import re
from pathlib import Path

import pytest

from texture_bringup.commands.start import refuse_wrong
from texture_bringup.launcher import (
    NodeDescription,
    command,
    expand,
    find_launch_file,
    joined_namespace,
    read,
    typed,
)
from texture_core import cli
from texture_core.errors import InvalidData, InvalidLaunch, InvalidParameter, UnknownName

ROOT = Path(__file__).parents[3]


@pytest.fixture
def launch(tmp_path, monkeypatch):
    """Return a function: elements of a launch file, arguments → nodes; a package 'p' is installed."""
    (tmp_path / 'share/ament_index/resource_index/packages').mkdir(parents=True)
    (tmp_path / 'share/ament_index/resource_index/packages/p').touch()
    (tmp_path / 'lib/p').mkdir(parents=True)
    (tmp_path / 'lib/p/e').touch(mode=0o755)
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path}')

    def read_elements(elements: str, **given: str) -> list[NodeDescription]:
        file = tmp_path / 'a.launch.xml'
        file.write_text(f'<launch>{elements}</launch>')
        return read(file, given, {'HOME': '/home/me'})

    read_elements.folder = tmp_path
    return read_elements


def test_an_argument_has_its_default_until_one_is_given(launch) -> None:
    elements = '<arg name="who" default="$(env HOME)"/><node pkg="p" exec="e" name="$(var who)"/>'
    assert launch(elements)[0].name == '/home/me'
    assert launch(elements, who='you')[0].name == 'you'


def test_while_the_files_of_a_launch_are_checked_it_says_so(tmp_path: Path, monkeypatch, capsys) -> None:
    cli.show_progress()
    monkeypatch.setattr(cli, 'QUIET_S', 0.0)
    replay = NodeDescription('texture_recordings', 'replay', parameters=({'bag': str(tmp_path)},))
    with pytest.raises(InvalidData, match='is not a bag'):
        refuse_wrong([replay])
    assert capsys.readouterr().err.startswith('checking what the launch was given, ')


def test_an_emulator_in_a_users_launch_file_may_leave_its_pipe_as_it_is() -> None:
    refuse_wrong([NodeDescription('texture_simulation', 'emulator')])


GIVEN = 'if="$(not-equals \'m$(var model)\' m)"'


@pytest.mark.parametrize(
    ('condition', 'model', 'nodes'),
    [
        ('if="true"', '', 1),
        ('if="0"', '', 0),
        ('unless="True"', '', 0),
        ('unless="$(var off)"', '', 1),
        ('if="true" unless="false"', '', 1),
        (GIVEN, '', 0),
        (GIVEN, 'a b/rough.json', 1),
    ],
)
def test_conditions_choose(launch, condition, model, nodes) -> None:
    elements = f'<arg name="model" default=""/><let name="off" value="false"/><node pkg="p" exec="e" {condition}/>'
    assert len(launch(elements, model=model)) == nodes


@pytest.mark.parametrize(
    ('elements', 'sentence'),
    [
        ('<arg name="bag"/>', 'give bag:=VALUE'),
        ('<arg name="s" default="felt"><choice value="cork"/><choice value="birch"/></arg>', 'one of cork, birch'),
        ('<nod pkg="p" exec="e"/>', "did you mean 'node'"),
        ('<node pkg="p" exe="e"/>', "did you mean 'exec'"),
        ('<node pkg="p" exec="e"><parm name="a" value="1"/></node>', "did you mean 'param'"),
        ('<arg name="speed" default="1"/><let name="x" value="$(var sped)"/>', "did you mean 'speed'"),
        ('<let name="x" value="$(find-pkg-shar p)"/>', "did you mean 'find-pkg-share'"),
        ('<node pkg="p" exec="e" if="yes"/>', 'true, false, 1 or 0'),
        ('<node pkg="p" exec="e" respawn_delay="soon"/>', 'a number is needed'),
        ('<node pkg="p" exec="e" respawn_max_retries="2.5"/>', 'a whole number is needed'),
        ('<node pkg="p" exec="e"><param name="x" value="1" type="flaot"/></node>', "did you mean 'float'"),
        ('<node pkg="p" exec="e"><param name="x" value="{a: 1}"/></node>', 'a number or a text is needed'),
        ('<node pkg="p" exec="e"><param name="x" value="null"/></node>', 'a number or a text is needed'),
        ('<let name="x" value="$(var x"/>', 'write $(name argument'),
        ('<let name="x" value="$(var  x)"/>', 'closed and with single spaces'),
        ('<let name="x" value="$()"/>', 'write $(name argument'),
        ('<include file="FOLDER/a.launch.xml"/>', 'include itself'),
        ('<include file="FOLDER/b.launch.xml"><arg name="m" value="1"/></include>', "no argument of b.launch.xml 'm'"),
        ('<include file="FOLDER/robot.launch.xml"/>', '<launch> is needed'),
        ('<node>', 'not well-formed'),
    ],
)
def test_what_a_launch_file_cannot_mean_is_refused_with_the_nearest_name(launch, elements, sentence) -> None:
    (launch.folder / 'b.launch.xml').write_text('<launch><arg name="n" default="none"/></launch>')
    (launch.folder / 'robot.launch.xml').write_text('<robot/>')
    with pytest.raises((InvalidLaunch, UnknownName), match=re.escape(sentence)):
        launch(elements.replace('FOLDER', str(launch.folder)))


def test_an_undeclared_argument_gets_the_nearest_also_of_one_behind_a_condition(launch) -> None:
    elements = '<group if="false"><arg name="model" default=""/></group>'
    assert launch(elements, model='x') == []
    with pytest.raises(UnknownName, match="'model'"):
        launch(elements, modl='x')


@pytest.mark.parametrize('name', ['emulator', 'replay'])
@pytest.mark.parametrize('given', [{}, {'model': 'my/model.npz'}, {'model': 'm.npz', 'recipe': 'ets-linear-svm'}])
def test_the_features_are_those_of_the_model_unless_a_recipe_is_given(name: str, given: dict[str, str]) -> None:
    nodes = read(find_launch_file(name), {'bag': 'my_bag', **given}, os.environ)
    [extractor] = [node for node in nodes if node.executable == 'feature_extractor']
    assert extractor.parameters[0] == {'recipe': given.get('recipe', given.get('model', ''))}


@pytest.mark.parametrize(
    ('given', 'listeners'),
    [({}, 'classifier'), ({'roughness_model': 'rough.json', 'end': 'true'}, 'classifier roughness_estimator')],
)
def test_a_replay_waits_for_all_estimators_that_it_starts(given: dict[str, str], listeners: str) -> None:
    nodes = read(find_launch_file('replay'), {'bag': 'my_bag', **given}, os.environ)
    [replay] = [node for node in nodes if node.executable == 'replay']
    assert {'listeners': listeners} in replay.parameters
    assert {node.name for node in nodes} >= set(listeners.split())


def test_a_group_keeps_its_changes_to_itself(launch) -> None:
    change = '<push_ros_namespace namespace="left"/><let name="n" value="inner"/><set_env name="E" value="1"/>'
    node = '<node pkg="p" exec="e" name="$(var n)"/>'
    inner, outer = launch(f'<let name="n" value="outer"/><group>{change}{node}</group>{node}')
    assert (inner.name, inner.namespace, inner.environment['E']) == ('inner', '/left', '1')
    assert (outer.name, outer.namespace, 'E' in outer.environment) == ('outer', '', False)


def test_an_include_gets_its_arguments_and_leaves_them_set_as_upstream_does(launch) -> None:
    inner = launch.folder / 'inner.launch.xml'
    inner.write_text('<launch><arg name="n" default="none"/><node pkg="p" exec="e" name="$(var n)"/></launch>')
    include = f'<include file="{inner}"><arg name="n" value="given"/></include>'
    assert [node.name for node in launch(include + '<node pkg="p" exec="e" name="$(var n)"/>')] == ['given', 'given']
    (launch.folder / 'middle.launch.xml').write_text(f'<launch><include file="{inner}"/></launch>')
    assert [node.name for node in launch(include.replace('inner', 'middle'))] == ['given']


def test_params_are_typed_and_kept_in_their_order_with_files(launch) -> None:
    (launch.folder / 'p.yaml').write_text('{}')
    params = (
        '<param name="rate" value="2.5"/><param name="count" value="$(var n)"/>'
        f'<param from="{launch.folder}/p.yaml"/><param name="id" value="$(var n)" type="str"/>'
    )
    (node,) = launch(f'<let name="n" value="5"/><node pkg="p" exec="e">{params}</node>')
    assert node.parameters == ({'rate': 2.5}, {'count': 5}, launch.folder / 'p.yaml', {'id': '5'})


def test_the_command_line_is_that_of_ros(launch, tmp_path) -> None:
    (node,) = launch(
        '<node pkg="p" exec="e" name="n" namespace="ns">'
        '<remap from="signal" to="/s"/><param name="rate" value="2"/></node>'
    )
    words = command(node, tmp_path / 'params')
    assert words[1:7] == ['--ros-args', '-r', '__node:=n', '-r', '__ns:=/ns', '--params-file']
    assert words[8:] == ['-r', 'signal:=/s']
    assert Path(words[7]).read_text() == '/ns/n:\n  ros__parameters:\n    rate: 2\n'


def test_an_unknown_package_or_executable_gets_the_nearest(launch, tmp_path) -> None:
    with pytest.raises(UnknownName, match="'p'"):
        command(NodeDescription('pp', 'e'), tmp_path)
    with pytest.raises(UnknownName, match="no executable of package 'p' 'ee'"):
        command(NodeDescription('p', 'ee'), tmp_path)


@pytest.mark.parametrize(
    ('base', 'name', 'joined'),
    [
        ('', '', ''),
        ('/a', '', '/a'),
        ('', 'b', '/b'),
        ('/a', 'b', '/a/b'),
        ('/a', '/c', '/c'),
        ('/', 'b', '/b'),
        ('/', '', '/'),
    ],
)
def test_a_namespace_is_joined_unless_it_is_absolute(base, name, joined) -> None:
    assert joined_namespace(base, name) == joined


@pytest.mark.parametrize('name', ['le ft', '9left', 'left/9', 'a//b', 'lëft', 'a-b'])
def test_a_namespace_that_ros_would_refuse_is_refused_with_what_is_allowed(launch, name) -> None:
    with pytest.raises(InvalidParameter, match='letters, digits and _'):
        launch(f'<push_ros_namespace namespace="{name}"/>')


@pytest.mark.parametrize(
    ('text', 'type_name', 'value'),
    [
        ('5', 'yaml', 5),
        ('5.0', 'yaml', 5.0),
        ('true', 'yaml', True),
        ("'5'", 'yaml', '5'),
        ('cork/5', 'yaml', 'cork/5'),
        ('', 'yaml', ''),
        ('@home', 'yaml', '@home'),
        ('5', 'str', '5'),
        ('5', 'float', 5.0),
        ('1e3', 'float', 1000.0),
        ('1', 'bool', True),
    ],
)
def test_values_are_typed_as_yaml_does_unless_a_type_is_given(text, type_name, value) -> None:
    got = typed(text, type_name, 'it')
    assert (got, type(got)) == (value, type(value))


def shown(name, arguments):
    return f'<{name}:{"|".join(arguments)}>'


@pytest.mark.parametrize(
    ('text', 'expanded'),
    [
        ('', ''),
        ('plain $5 (text)', 'plain $5 (text)'),
        ('a $(var x) b', 'a <var:x> b'),
        ('$(env XDG /tmp)/finger', '<env:XDG|/tmp>/finger'),
        ('$(env $(var name) "a b")', '<env:<var:name>|a b>'),
        ("$(env X '')", '<env:X|>'),
    ],
)
def test_calls_are_expanded_innermost_first_and_all_else_stays(text, expanded) -> None:
    assert expand(text, shown) == expanded


@pytest.mark.parametrize('file', ['tactile', 'ur'])
def test_the_settings_of_a_sensor_reach_its_node(file) -> None:
    given = {'emulated': 'false', 'device': '/dev/ttyACM0', 'sensor_config': 'four_channels.yaml'}
    given |= {'ip': '192.0.2.1'} if file == 'ur' else {}
    nodes = read(ROOT / f'src/texture_bringup/launch/{file}.launch.xml', given, dict(os.environ))
    [sensor] = [node for node in nodes if node.executable == 'sensor']
    assert {'config': 'four_channels.yaml'} in [*sensor.parameters]
