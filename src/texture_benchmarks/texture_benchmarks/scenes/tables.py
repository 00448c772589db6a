"""Tables of what simulated scenes cost, and of what their terms are worth, as markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from texture_benchmarks.scenes.costs import Load, ScanCost
from texture_benchmarks.scenes.trial import Ablation, Difference


def cost_table(
    costs: Mapping[tuple[str, bool], ScanCost], target_ms: Mapping[bool, float], loads: Mapping[str, Load]
) -> str:
    """Return what a slide of each scene costs, and its emulated device."""
    rows = []
    for (name, sticks), cost in costs.items():
        of_load = loads.get(name) if sticks or (name, True) not in costs else None
        device = f'{100 * of_load.cpu:.0f} ({of_load.rate_hz / 1000:g} kHz × {of_load.channels})' if of_load else ''
        kind = f'`{name}`, stick-slip' if sticks else f'`{name}`'
        times = (f'{value:.2f}' for value in (cost.together_ms, cost.worst_ms, cost.alone_ms))
        rows.append((kind, *times, f'{target_ms[sticks]:g}', device))
    heads = ('scene', 'each of many at once (ms)', 'dearest surface (ms)', 'alone (ms)', 'allowed (ms)')
    return _table((*heads, 'device in real time (% of a core)'), rows)


def term_table(ablations: Sequence[Ablation]) -> str:
    """Return for each term of each scene what it costs, and how the accuracy changes when it is removed."""
    rows = [
        (
            f'`{ablation.scene}`',
            worth.term.replace('_', ' '),
            f'{worth.cost_us:.0f}',
            _points(worth.easier),
            _points(worth.unprepared),
            _points(worth.paper) if worth.paper else '',
            worth.verdict,
        )
        for ablation in ablations
        for worth in ablation.worths
    ]
    heads = ('scene', 'term', 'costs (µs a slide)', 'change if nowhere (points)', 'change if not learnt from (points)')
    return _table((*heads, "the paper's method, if nowhere", 'verdict'), rows)


def added_table(added: Sequence[Ablation]) -> str:
    """Return for each effect put into a scene what it costs, and how well surfaces are then told apart."""
    rows = []
    for ablation in added:
        for worth in ablation.worths:
            known, strange = (_points(difference) for difference in (_less(worth.easier), worth.unprepared))
            rows.append((f'`{worth.term}`', f'{worth.cost_us:.0f}', known, strange, worth.verdict))
    heads = (
        'effect',
        'costs (µs a slide)',
        'change if met and learnt (points)',
        'further change if not learnt (points)',
    )
    return _table((*heads, 'verdict'), rows)


def _less(difference: Difference) -> Difference:
    return Difference(-difference.mean, difference.half)


def _points(difference: Difference) -> str:
    return f'{100 * difference.mean:+.1f} ± {100 * difference.half:.1f}'


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = (heads, ['---'] * len(heads), *rows)
    return ''.join(f'| {" | ".join(line)} |\n' for line in lines)
