from pathlib import Path

from texture_recordings.commands.import_ import source_folder
from texture_recordings.tables import mapping_from


def test_the_parent_of_the_folder_of_a_data_set_may_be_given(tmp_path: Path) -> None:
    assert source_folder(str(tmp_path), 'biotac20') == tmp_path
    (tmp_path / 'biotac20').mkdir()
    assert source_folder(str(tmp_path), 'biotac20') == tmp_path / 'biotac20'


def test_a_condition_may_be_written_as_a_number() -> None:
    content = {
        'streams': {'signal': {'columns': ['ax']}},
        'label': {'column': 'material'},
        'conditions': {'speed': {'value': 0.03}},
    }
    assert float(mapping_from(content).conditions.speed.value) == 0.03
