import threading

import pytest
from std_srvs.srv import Trigger

from texture_bringup import operator as operators
from texture_bringup.command import installed, main
from texture_bringup.service_command import SERVICE_COMMANDS
from texture_core.ros_testing import LocalGraph

pytestmark = pytest.mark.ros


class Answering:
    """Stand in for the operator: note what is called, and answer."""

    def __init__(self, answer):
        self.answer, self.namespaces, self.called = answer, [], []

    def __call__(self, namespace):
        self.namespaces.append(namespace)
        return self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def call(self, service, _advice):
        self.called.append(service)
        return self.answer


@pytest.mark.parametrize('name', SERVICE_COMMANDS)
@pytest.mark.parametrize('success', [True, False])
def test_a_command_calls_its_service_and_ends_with_its_success(name, success, monkeypatch, capsys):
    operator = Answering((success, 'as it is'))
    monkeypatch.setattr('texture_bringup.service_command.Operator', operator)
    assert main([name, '--namespace', 'left']) == (0 if success else 1)
    assert capsys.readouterr().out == 'as it is\n'
    assert (operator.namespaces, operator.called) == (['left'], [name.replace('-', '_')])


def test_every_row_of_the_table_is_a_sub_command():
    assert set(SERVICE_COMMANDS) <= set(installed())


@pytest.mark.realtime
def test_a_service_that_no_node_offers_is_one_sentence_and_exit_code_2(monkeypatch, capsys):
    monkeypatch.setattr(operators, 'OFFERED_S', 0.2)
    monkeypatch.setenv('ROS_DOMAIN_ID', '97')
    assert main(['stop', '--namespace', 'left']) == 2
    said = capsys.readouterr().err
    assert "no node offers the service '/left/stop'" in said
    assert said.count('\n') == 1


@pytest.mark.realtime
def test_the_answer_of_a_running_node_is_printed(monkeypatch, capsys):
    monkeypatch.setenv('ROS_DOMAIN_ID', '97')
    with LocalGraph(97, deadline_s=60.0) as graph:
        graph.peer.create_service(Trigger, 'recover', lambda _request, _answer: Trigger.Response(message='it burns'))
        codes = []
        asking = threading.Thread(target=lambda: codes.append(main(['recover'])))
        asking.start()
        graph.until(lambda: bool(codes))
        asking.join()
    assert codes == [1]
    assert capsys.readouterr().out == 'it burns\n'
