# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import rclpy
from rclpy.parameter import Parameter

from texture_core.config import check_parameter_file, param
from texture_core.errors import InvalidParameter
from texture_core.ros import check_names, declare, on_change, read, run
from texture_core.ros_testing import LocalGraph

pytestmark = pytest.mark.ros


@dataclass(frozen=True)
class Params:
    length_s: float = param(0.5, 'Length of one window.', unit='s', low=0.01, high=10.0)
    name: str = param('x', 'A name.', choices=('x', 'y'))


@pytest.fixture
def make_node() -> Iterator[Any]:
    with LocalGraph(63) as graph:
        yield partial(graph.add, partial(rclpy.create_node, 'n'))


def test_defaults_ranges_and_descriptions_reach_ros(make_node: Any) -> None:
    node = make_node()
    assert declare(node, Params) == Params()
    descriptor = node.describe_parameter('length_s')
    assert descriptor.description == 'Length of one window. [s]'
    assert descriptor.floating_point_range[0].to_value == 10.0


@pytest.mark.parametrize('given', [2.0, 2])
def test_a_given_value_is_used_and_a_whole_number_is_taken_for_a_float(make_node: Any, given: float) -> None:
    assert declare(make_node(length_s=given), Params).length_s == 2.0


@pytest.mark.parametrize('bad', [{'length_s': 11.0}, {'length_s': 'long'}, {'name': 'z'}])
def test_a_bad_value_is_refused_in_one_sentence(make_node: Any, bad: dict[str, Any]) -> None:
    with pytest.raises(InvalidParameter, match=next(iter(bad))):
        declare(make_node(**bad), Params)


def test_a_change_that_nobody_follows_is_refused(make_node: Any) -> None:
    node = make_node()
    declare(node, Params)
    outcome = node.set_parameters([Parameter('name', value='y')])[0]
    assert not outcome.successful
    assert 'read-only' in outcome.reason
    assert read(node, Params) == Params()


def test_a_refused_change_is_not_set(make_node: Any) -> None:
    node = make_node()
    declare(node, Params, changeable=True)
    seen = []
    on_change(node, Params, seen.append)
    assert not node.set_parameters([Parameter('name', value='z')])[0].successful
    assert node.set_parameters([Parameter('name', value='y')])[0].successful
    assert seen == [Params(name='y')]
    assert read(node, Params).name == 'y'


def test_a_parameter_that_the_node_does_not_know_is_named_in_a_warning(make_node: Any, capfd: Any) -> None:
    node = make_node(colour=2.0, length_s=2.0)
    declare(node, Params)
    check_names(node)
    [line] = capfd.readouterr().err.splitlines()
    assert "this has no effect: no parameter 'colour'. Known: " in line


def test_a_node_that_shares_the_file_of_another_takes_what_it_knows_and_says_nothing(
    make_node: Any, capfd: Any
) -> None:
    node = make_node(colour=2.0, naem='x', name='y')
    node.shares_file = True
    assert declare(node, Params).name == 'y'
    check_names(node)
    assert not capfd.readouterr().err


def start(*words: str) -> None:
    """Run a node called 'n' with the words of a command line, until its parameters are checked."""

    def n() -> Any:
        node = rclpy.create_node('n')
        raise InvalidParameter(f'it starts with {declare(node, Params)}')

    run(n, ['--ros-args', *words])


def error_line(capfd: Any, *words: str) -> str:
    with pytest.raises(SystemExit) as ended:
        start(*words)
    assert ended.value.code == 2
    [line] = capfd.readouterr().err.splitlines()
    return str(line)


def write(path: Path, text: str) -> tuple[str, str]:
    path.write_text(text)
    return '--params-file', str(path)


PRESET = '/**:\n  ros__parameters: {name: x}\n/**/n:\n  ros__parameters: {length_s: 5.0}\n'


@pytest.mark.parametrize(('section', 'value'), [('/**', '3.0'), ('/**/n', '3'), ('n', '3')])
def test_the_last_file_counts_whatever_its_section_and_however_the_number_is_written(
    tmp_path: Path, capfd: Any, section: str, value: str
) -> None:
    preset = write(tmp_path / 'preset.yaml', PRESET)
    robot = write(tmp_path / 'robot.yaml', f'{section}:\n  ros__parameters: {{length_s: {value}}}\n')
    assert 'length_s=3.0' in error_line(capfd, *preset, *robot)
    assert 'length_s=2.0' in error_line(capfd, *preset, *robot, '-p', 'length_s:=2')


@pytest.mark.parametrize('value', ['8.0N', '"8.0"', 'true', '6,5'])
def test_a_mistyped_value_is_refused_in_any_order_of_files(tmp_path: Path, capfd: Any, value: str) -> None:
    preset = write(tmp_path / 'preset.yaml', PRESET)
    robot = write(tmp_path / 'robot.yaml', f'/**/n:\n  ros__parameters:\n    length_s: {value}\n')
    for words in ((*preset, *robot), (*robot, *preset)):
        line = error_line(capfd, *words)
        assert f"{robot[1]}': parameter 'length_s' is " in line
        assert 'a number is needed, 0.01 to 10.0 s' in line


@pytest.mark.parametrize('text', ['n:\n  length_s: 8.0\n', 'n:\n  ros__parameters:\n\tlength_s: 8.0\n', 'length_s\n'])
def test_a_file_with_a_wrong_layout_is_refused_in_one_sentence(tmp_path: Path, capfd: Any, text: str) -> None:
    words = write(tmp_path / 'robot.yaml', text)
    line = error_line(capfd, *words)
    assert words[1] in line
    assert "below it 'ros__parameters:'" in line
    with pytest.raises(InvalidParameter, match=r"robot\.yaml.*below it 'ros__parameters:'"):
        check_parameter_file(Path(words[1]))


@pytest.mark.parametrize('section', ['/**', '/**/n', '/*/n', '/left/**', '/**/left/n', 'left/n', '/left/n', '/*/*'])
def test_a_section_that_reaches_the_node_as_ros_matches_names_is_allowed(tmp_path: Path, section: str) -> None:
    words = write(tmp_path / 'robot.yaml', f'{section}:\n  ros__parameters: {{length_s: 3.0}}\n')
    check_parameter_file(Path(words[1]), '/left/n')


@pytest.mark.parametrize('section', ['/**/nn', 'n', '/q/n', '/*/*/n', '/p/*/n', '/p/n/**/m'])
def test_a_node_that_owns_its_file_refuses_a_section_that_does_not_reach_it(
    tmp_path: Path, capfd: Any, section: str
) -> None:
    words = write(tmp_path / 'robot.yaml', f'{PRESET}{section}:\n  ros__parameters: {{length_s: 3.0}}\n')

    def n() -> Any:
        node = rclpy.create_node('n', namespace='p')
        node.owns_file = True
        return declare(node, Params)

    with pytest.raises(SystemExit):
        run(n, ['--ros-args', *words])
    shown = f'/{section.lstrip("/")}'
    assert (
        f"has the section '{shown}', which is not for node '/p/n'; allowed are /**, /**/n, /p/n: "
        in capfd.readouterr().err
    )


@pytest.mark.parametrize('section', ['/**', '/**/n', 'p/n', '/p/n', 'p:\n  n'])
def test_a_node_that_owns_its_file_takes_each_section_that_reaches_it(tmp_path: Path, section: str) -> None:
    words = write(tmp_path / 'robot.yaml', f'{section}:\n    ros__parameters: {{length_s: 3.0}}\n')
    taken = []

    def n() -> Any:
        node = rclpy.create_node('n', namespace='p')
        node.owns_file = True
        taken.append(declare(node, Params))
        raise InvalidParameter('enough')

    with pytest.raises(SystemExit):
        run(n, ['--ros-args', *words])
    assert taken == [Params(length_s=3.0)]


@pytest.mark.parametrize('section', ['/**', '/n', '/**/n'])
def test_a_node_with_a_misspelled_parameter_does_not_start(tmp_path: Any, capfd: Any, section: str) -> None:
    file = tmp_path / 'robot.yaml'
    file.write_text(f'{section}:\n  ros__parameters:\n    lenght_s: 2.0\n')

    def n() -> Any:
        node = rclpy.create_node('n')
        declare(node, Params)
        return node

    with pytest.raises(SystemExit) as ended:
        run(n, ['--ros-args', '--params-file', str(file)])
    assert ended.value.code == 2
    assert "texture: node 'n' has no parameter 'lenght_s'; did you mean 'length_s'? Correct" in capfd.readouterr().err
