# SPDX-License-Identifier: Apache-2.0
import io
import subprocess
import sys
import zipfile

import numpy as np
import pytest
from sklearn.preprocessing import StandardScaler
from skops.io import dumps, loads

from texture_core.config import Archive
from texture_estimation.model_files import read_plain_skops

PLAIN = {
    'weights': np.arange(6.0).reshape(2, 3),
    'codes': np.array([1, 2], dtype=np.int16),
    'names': np.array(['a', 'bé']),
    'deeper': {'list': [1, 2.5, 'x', None, True, {'y': np.zeros(0)}], 'scalar': np.float32(0.5)},
}


def read(content: bytes):
    with Archive(io.BytesIO(content)) as file:
        return read_plain_skops(file)


def test_plain_values_are_read_as_the_library_reads_them() -> None:
    content = dumps(PLAIN)
    ours, theirs = read(content), loads(content)
    np.testing.assert_equal(ours, theirs)
    assert list(ours) == list(PLAIN)
    assert ours['codes'].dtype == np.int16
    assert type(ours['deeper']['scalar']) is type(theirs['deeper']['scalar'])


@pytest.mark.parametrize(
    'parameters',
    [{'scaler': StandardScaler()}, {1: 2.0}, {'set': {1}}, {'pair': (1, 2)}, {'objects': np.array([None])}, [1.0]],
)
def test_what_is_not_plain_is_left_to_the_library(parameters) -> None:
    assert read(dumps(parameters)) is None


def test_a_file_without_its_arrays_or_its_schema_is_not_plain() -> None:
    whole = io.BytesIO(dumps(PLAIN))
    for missing in ('schema.json', '.npy'):
        less = io.BytesIO()
        with zipfile.ZipFile(whole) as old, zipfile.ZipFile(less, 'w') as new:
            for name in old.namelist():
                if not name.endswith(missing):
                    new.writestr(name, old.read(name))
        assert read(less.getvalue()) is None


def test_a_node_that_classifies_does_not_wait_for_libraries_of_training(model, tmp_path) -> None:
    program = (
        'import sys; from texture_estimation.model import load_model; load_model(sys.argv[1]); '
        "print(sorted({'sklearn', 'skops'} & set(sys.modules)))"
    )
    path = model.save(tmp_path / 'model')
    reported = subprocess.run([sys.executable, '-c', program, path], check=True, capture_output=True, text=True)
    assert reported.stdout == '[]\n'
