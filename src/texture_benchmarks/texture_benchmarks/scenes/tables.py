"""Tables of what simulated scenes cost, and of what their terms contribute, as markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from texture_benchmarks.scenes.costs import DeviceLoad, ScanCost
from texture_benchmarks.scenes.trial import Ablation, MeanDifference, TermEffect


def cost_table(
    costs: Mapping[tuple[str, bool], ScanCost], target_ms: Mapping[bool, float], loads: Mapping[str, DeviceLoad]
) -> str:
    """Return what a slide of each scene costs, and its emulated device.

    Parameters
    ----------
    costs
        Scene and whether many slides are made at once → time of a slide.
    target_ms
        Allowed time of a single slide, and of one of many.
    loads
        Scene → load of its emulated device.

    Returns
    -------
    str
        Table in Markdown.
    """
    rows = []
    for (name, sticks), cost in costs.items():
        of_load = loads.get(name) if sticks or (name, True) not in costs else None
        device = f'{100 * of_load.cpu:.0f} ({of_load.rate_hz / 1000:g} kHz × {of_load.channels})' if of_load else ''
        kind = f'`{name}`, stick-slip' if sticks else f'`{name}`'
        times = (f'{value:.2f}' for value in (cost.together_ms, cost.worst_ms, cost.alone_ms))
        rows.append((kind, *times, f'{target_ms[sticks]:g}', device))
    headings = ('scene', 'each of many at once (ms)', 'slowest surface (ms)', 'alone (ms)', 'target (ms)')
    return _table((*headings, 'device in real time (% of a core)'), rows)


def _term_row(scene: str, effect: TermEffect) -> tuple[str, ...]:
    return (
        f'`{scene}`',
        effect.term.replace('_', ' '),
        f'{effect.cost_us:.0f}',
        _points(effect.easier),
        _points(effect.unprepared),
        _points(effect.paper) if effect.paper else '',
        effect.verdict,
    )


def term_table(ablations: Sequence[Ablation]) -> str:
    """Return for each term of each scene what it costs, and how the accuracy changes when it is removed."""
    rows = [_term_row(ablation.scene, effect) for ablation in ablations for effect in ablation.term_effects]
    headings = (
        'scene',
        'term',
        'computing time (µs a slide)',
        'left out of training and test (points)',
        'left out of training only (points)',
        "left out of both, the paper's method (points)",
    )
    return _table((*headings, 'verdict'), rows)


def added_table(added: Sequence[Ablation]) -> str:
    """Return for each effect put into a scene what it costs, and how well surfaces are then distinguished."""
    rows = []
    for ablation in added:
        for term_effect in ablation.term_effects:
            known, novel = (_points(difference) for difference in (_less(term_effect.easier), term_effect.unprepared))
            rows.append((f'`{term_effect.term}`', f'{term_effect.cost_us:.0f}', known, novel, term_effect.verdict))
    headings = (
        'effect',
        'computing time (µs a slide)',
        'added to training and test (points)',
        'further change if left out of training (points)',
    )
    return _table((*headings, 'verdict'), rows)


def _less(difference: MeanDifference) -> MeanDifference:
    return MeanDifference(-difference.mean, difference.half)


def _points(difference: MeanDifference) -> str:
    return f'{100 * difference.mean:+.1f} ± {100 * difference.half:.1f}'


def _table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = (headings, ['---'] * len(headings), *rows)
    return ''.join(f'| {" | ".join(line)} |\n' for line in lines)
