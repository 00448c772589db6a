import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from texture_drivers.cobs import stuff, unstuff

RUN = bytes(range(1, 255))
# The examples of the paper and of its encyclopaedia article: data, stuffed.
EXAMPLES = [
    ('', '01'),
    ('00', '01 01'),
    ('00 00', '01 01 01'),
    ('11 22 00 33', '03 11 22 02 33'),
    ('11 22 33 44', '05 11 22 33 44'),
    ('11 00 00 00', '02 11 01 01 01'),
    (RUN.hex(), 'FF' + RUN.hex()),
    ('00' + RUN.hex(), '01 FF' + RUN.hex()),
    (RUN.hex() + 'FF', 'FF' + RUN.hex() + '02 FF'),
    (RUN[1:].hex() + 'FF 00', 'FF' + RUN[1:].hex() + 'FF 01 01'),
    (RUN[2:].hex() + 'FF 00 01', 'FE' + RUN[2:].hex() + 'FF 02 01'),
]


@pytest.mark.parametrize(('data', 'stuffed'), EXAMPLES)
def test_published_examples_come_out(data, stuffed):
    assert stuff(bytes.fromhex(data)) == bytes.fromhex(stuffed)
    assert unstuff(bytes.fromhex(stuffed)) == bytes.fromhex(data)


@settings(deadline=None)  # a busy machine is slow
@given(st.lists(st.sampled_from([b'', RUN, RUN[:-1], RUN + b'x', b'abc', b'\x00']), max_size=8).map(b'\x00'.join))
def test_whatever_is_stuffed_comes_back_and_has_no_zero(data):
    stuffed = stuff(data)
    assert 0 not in stuffed
    assert unstuff(stuffed) == data
    assert len(stuffed) <= len(data) + 1 + len(data) // 254


@settings(deadline=None)
@given(st.binary(max_size=600).filter(lambda data: 0 not in data))
def test_damaged_bytes_never_raise(data):
    unstuff(data)
