import numpy as np
import pytest

from texture_benchmarks.sensors.trial import CHECKED, LINES, line_figures
from texture_simulation.devices.faults import ByteFaults


@pytest.mark.parametrize('sensor', LINES)
def test_a_good_line_loses_nothing(sensor: str) -> None:
    figures = line_figures(ByteFaults(), np.random.default_rng(0), n_packets=2000, sensor=sensor)
    assert (figures.genuine, figures.bogus, figures.refused) == (figures.sent, 0, 0)


@pytest.mark.parametrize('sensor', sorted(CHECKED))
@pytest.mark.parametrize('kind', ['drop', 'insert', 'flip'])
@pytest.mark.parametrize('rate', [1e-4, 1e-2])
def test_a_checksum_lets_nothing_bogus_through(sensor: str, kind: str, rate: float) -> None:
    figures = line_figures(ByteFaults(**{kind: rate}), np.random.default_rng(3), n_packets=3000, sensor=sensor)
    assert figures.bogus == 0
    assert 0 < figures.genuine < figures.sent
    assert figures.refused > 0


@pytest.mark.parametrize('faults', [ByteFaults(drop=1e-3), ByteFaults(insert=1e-3), ByteFaults(drop=1e-4)])
def test_lost_and_added_bytes_let_no_bogus_packet_through(faults: ByteFaults) -> None:
    figures = line_figures(faults, np.random.default_rng(1))
    assert figures.bogus == 0
    assert figures.genuine_share > 0.93
    assert figures.refused > 0


def test_a_flipped_bit_is_refused_unless_it_hits_a_value() -> None:
    figures = line_figures(ByteFaults(flip=1e-3), np.random.default_rng(2))
    assert figures.genuine_share > 0.93
    # Of the 47 bytes of a dynamic packet 36 are values (stamp, dynamic, inertial) and one the unused checksum.
    assert 0 < figures.bogus < 0.05 * figures.sent
