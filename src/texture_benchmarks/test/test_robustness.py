import numpy as np
import pytest

from texture_benchmarks.sensors.trial import CHECKSUMMED, PROTOCOLS, link_statistics
from texture_simulation.devices.faults import ByteFaults


@pytest.mark.parametrize('sensor', PROTOCOLS)
def test_a_good_line_loses_nothing(sensor: str) -> None:
    figures = link_statistics(ByteFaults(), np.random.default_rng(0), n_packets=2000, sensor=sensor)
    taken = figures.sent - PROTOCOLS[sensor].passed_over
    assert (figures.correct_packets, figures.false_packets, figures.refused) == (taken, 0, 0)


@pytest.mark.parametrize('sensor', sorted(CHECKSUMMED))
@pytest.mark.parametrize('kind', ['drop', 'insert', 'flip'])
@pytest.mark.parametrize('rate', [1e-4, 1e-2])
def test_a_checksum_lets_nothing_false_through(sensor: str, kind: str, rate: float) -> None:
    figures = link_statistics(ByteFaults(**{kind: rate}), np.random.default_rng(3), n_packets=3000, sensor=sensor)
    assert figures.false_packets == 0
    assert 0 < figures.correct_packets < figures.sent
    assert figures.refused > 0


@pytest.mark.parametrize('faults', [ByteFaults(drop=1e-3), ByteFaults(insert=1e-3), ByteFaults(drop=1e-4)])
def test_lost_and_added_bytes_let_no_false_packet_through(faults: ByteFaults) -> None:
    figures = link_statistics(faults, np.random.default_rng(1))
    assert figures.false_packets == 0
    assert figures.correct_share > 0.93
    assert figures.refused > 0


def test_a_flipped_bit_is_refused_unless_it_hits_a_value() -> None:
    figures = link_statistics(ByteFaults(flip=1e-3), np.random.default_rng(2))
    assert figures.correct_share > 0.93
    # Of the 47 bytes of a dynamic packet 36 are values (stamp, dynamic, inertial) and one the unused checksum.
    assert 0 < figures.false_packets < 0.05 * figures.sent
