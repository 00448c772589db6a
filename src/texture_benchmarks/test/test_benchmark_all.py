import os
import re
import signal
from functools import partial
from pathlib import Path

from texture_benchmarks.catalogue import BENCHMARKS
from texture_benchmarks.run_all import LONG, SIDE_BY_SIDE, in_processes, run_all

NAMES = ('good', 'killed', 'bad', 'clock', 'missing')


def act(name: str, folder: Path) -> int:
    if name == 'killed':
        os.kill(os.getpid(), signal.SIGKILL)
    if name == 'bad':
        raise ValueError('deliberately, for the test')
    (folder / name).touch(exist_ok=False)
    return 3 if name == 'missing' else 0


def test_one_that_fails_or_is_killed_stops_no_other(tmp_path: Path) -> None:
    for at_once in (1, 3):
        folder = tmp_path / str(at_once)
        folder.mkdir()
        codes = in_processes(NAMES, partial(act, folder=folder), at_once)
        assert codes == {'good': 0, 'killed': -signal.SIGKILL, 'bad': 1, 'clock': 0, 'missing': 3}


def test_all_run_once_whether_side_by_side_or_alone(tmp_path: Path) -> None:
    assert run_all(['good', 'clock'], partial(act, folder=tmp_path)) == {'clock': 0, 'good': 0}
    assert {path.name for path in tmp_path.iterdir()} == {'good', 'clock'}


def test_every_benchmark_has_its_line_on_the_page_and_what_is_scheduled_exists() -> None:
    assert {*SIDE_BY_SIDE, *LONG} < set(BENCHMARKS)
    page = (Path(__file__).resolve().parents[3] / 'docs' / 'benchmarks.md').read_text()
    assert re.findall(r'^\| `(\w+)` \|', page, re.MULTILINE) == list(BENCHMARKS)
