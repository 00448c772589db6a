import pytest

from texture_core.errors import InvalidData
from texture_core.types import ExplorationState, Phase, RoughnessEstimate, TextureEstimate
from texture_recordings.bags import TYPES, decode, encode


@pytest.mark.parametrize(
    'value',
    [
        ExplorationState(
            1, 'e', 'circular', Phase.SLIDE, 0.5, 0.1, 2.0, 0.0, 0.5, 'cork', 0.1, 0.0, 2e-3, 'surface', 0.6
        ),
        TextureEstimate(
            1, 'e', 'cork', True, 0.9, ('cork', 'felt'), (0.9, 0.1), True, ('cork',), 3, 0.7, frame_id='tip'
        ),
        RoughnessEstimate(1, 'e', True, 3.5, 0.4),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_value_comes_back_equal_to_the_type_of_each_field(value: object) -> None:
    assert decode(encode(value), TYPES[type(value)]) == value


@pytest.mark.parametrize('missing', [1, 8, 16])  # bytes; 8 are the whole last field
def test_a_message_that_is_cut_off_is_refused_even_where_a_field_ends(missing: int) -> None:
    state = ExplorationState(1, 'e', 'circular', Phase.SLIDE, 0.5, 0.1, 2.0, z_m=2e-3, tangential_force_n=0.6)
    with pytest.raises(InvalidData, match='bytes came as a texture_msgs/msg/ExplorationState, which they are not'):
        decode(encode(state)[:-missing], TYPES[ExplorationState])
