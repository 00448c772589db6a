from __future__ import annotations

from pathlib import Path

import pytest

from texture_core.config import find_file, folder
from texture_core.errors import UnknownName


def test_a_path_of_the_user_wins(tmp_path: Path) -> None:
    path = tmp_path / 'mine.yaml'
    path.write_text('')
    assert find_file(str(path), 'texture_core', 'config', 'recipe') == path


def test_a_shipped_file_is_found_by_name_in_an_installation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shipped = tmp_path / 'share' / 'some_package' / 'config'
    shipped.mkdir(parents=True)
    (shipped / 'good.yaml').write_text('')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path}')
    assert folder('some_package', 'config') == shipped
    assert find_file('good', 'some_package', 'config', 'recipe') == shipped / 'good.yaml'
    with pytest.raises(UnknownName, match="no recipe 'goood'; did you mean 'good'"):
        find_file('goood', 'some_package', 'config', 'recipe')


@pytest.mark.parametrize('name', ['mine.yaml', 'some/folder/mine'])
def test_a_missing_file_of_the_user_is_not_called_an_unknown_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UnknownName, match=f"there is no file '{name}' in '{tmp_path}'"):
        find_file(name, 'texture_core', 'config', 'recipe')
