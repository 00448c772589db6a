import socket

from texture_bringup.demo import FIRST_PORT, FIRST_UNICAST, PORTS_PER_DOMAIN, free_port, isolate


def test_a_domain_in_use_is_left_alone(tmp_path) -> None:
    first = isolate(tmp_path)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(('', FIRST_PORT + PORTS_PER_DOMAIN * first.domain_id + FIRST_UNICAST))
        assert isolate(tmp_path).domain_id != first.domain_id


def test_the_environment_names_the_domain_and_stays_on_this_machine(tmp_path) -> None:
    isolation = isolate(tmp_path)
    environment = isolation.environment({'PATH': '/bin', 'ROS_DOMAIN_ID': '0'})
    assert environment['ROS_DOMAIN_ID'] == str(isolation.domain_id)
    assert environment['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    assert environment['PATH'] == '/bin'


def test_a_free_port_can_be_bound() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('127.0.0.1', free_port()))
