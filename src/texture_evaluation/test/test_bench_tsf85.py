import json
from pathlib import Path

from texture_evaluation.benches.result import Bench
from texture_evaluation.benches.tsf85 import run


def test_without_faults_all_samples_arrive_and_rare_faults_cost_little(tmp_path: Path) -> None:
    result = run(Bench(tmp_path, quick=True))
    numbers = json.loads(result.write(tmp_path).read_text())['numbers']
    assert numbers['without_faults']['recovered'] == 1.0
    assert numbers['without_faults']['refused_bytes'] == 0
    for kind in ('drop', 'insert', 'flip'):
        assert numbers[kind]['0.0001']['recovered'] > 0.98
    assert result.charts[0].is_file()
