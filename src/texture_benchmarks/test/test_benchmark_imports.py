"""Data sets for benchmarks: imported once for all that run together, or in part for one."""

from pathlib import Path

import pytest

from texture_benchmarks import imported_data as imports
from texture_benchmarks.imported_data import imported, importing_once
from texture_benchmarks.result import BenchmarkOptions
from texture_core.errors import InvalidData


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list:
    """Return what is asked of an importer of one bag a material, for the data set 'wool', which is there."""
    calls = []

    def importer(source: Path, out: Path, slides: str = '', materials: tuple[str, ...] = ()) -> list[Path]:
        calls.append((source.name, slides, materials))
        bags = [Path(out) / name for name in materials or ('a', 'b')]
        for bag in bags:
            bag.mkdir(parents=True)
        return bags

    monkeypatch.setattr(imports, 'IMPORTS', {'wool': importer, 'cork': importer})
    (tmp_path / 'wool').mkdir()
    return calls


def test_all_that_run_together_get_the_same_bags(asked, tmp_path: Path) -> None:
    with importing_once(BenchmarkOptions(tmp_path, tmp_path), ('wool', 'cork')) as options:
        for _ in range(2):
            with imported(options, 'wool') as bags:
                assert [bag.name for bag in bags] == ['a', 'b']
                assert all(bag.is_dir() for bag in bags)
    assert asked == [('wool', '', ())]
    assert not bags[0].exists()


def test_a_part_is_imported_for_itself_and_so_is_what_one_benchmark_needs_alone(asked, tmp_path: Path) -> None:
    options = BenchmarkOptions(tmp_path, tmp_path)
    with importing_once(options, ('wool',)) as sharing, imported(sharing, 'wool', '1-3', ('b',)) as bags:
        assert [bag.name for bag in bags] == ['b']
    with imported(options, 'wool') as bags:
        assert len(bags) == 2
    assert not bags[0].exists()
    assert asked == [('wool', '', ()), ('wool', '1-3', ('b',)), ('wool', '', ())]


def test_what_is_missing_is_reported_by_the_benchmark_that_needs_it(asked, tmp_path: Path) -> None:
    for data in (tmp_path, None):
        with (
            importing_once(BenchmarkOptions(tmp_path, data), ('cork',)) as options,
            pytest.raises(InvalidData, match='cork/ with --data'),
            imported(options, 'cork'),
        ):
            pass
    assert asked == []


def test_a_damaged_data_set_stops_no_benchmark_but_those_that_need_it(asked, monkeypatch, tmp_path: Path) -> None:
    good = imports.IMPORTS['wool']

    def damaged(source: Path, out: Path, *_: object) -> list[Path]:
        (Path(out) / 'half').mkdir(parents=True)
        raise InvalidData('it is no file of this data set')

    monkeypatch.setattr(imports, 'IMPORTS', {'cork': damaged, 'wool': good})
    (tmp_path / 'cork').mkdir()
    with importing_once(BenchmarkOptions(tmp_path, tmp_path), ('cork', 'wool')) as options:
        with imported(options, 'wool') as bags:
            assert len(bags) == 2
        with pytest.raises(InvalidData, match='no file of this data set'), imported(options, 'cork'):
            pass


def test_a_quick_run_imports_its_parts_alone(asked, tmp_path: Path) -> None:
    with importing_once(BenchmarkOptions(tmp_path, tmp_path, quick=True), ('wool',)):
        pass
    assert asked == []
