"""How well 20 recorded materials are recognised from slides of a later time than those trained on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from texture_benchmarks.charts import confusion_chart, evidence_chart
from texture_benchmarks.imported_data import imported
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_benchmarks.shared_models import trained_once
from texture_estimation.recipe import load_recipe
from texture_evaluation.evaluate import EvaluationReport, evaluate
from texture_evaluation.metrics import curve
from texture_evaluation.train import train_from_bags

RECIPES = {'default': 'vibration alone', 'vibration-and-taxels': 'vibration, electrodes, pressure and temperature'}
TRAINED, TESTED = '1-30', '31-40'
QUICK_MATERIALS = ('material01', 'material02', 'material03')


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on the first 30 slides of each material, test on the last 10."""
    with imported(options, 'biotac20', materials=QUICK_MATERIALS if options.quick else ()) as bags:
        reports = {recipe: _report(recipe, bags, options) for recipe in RECIPES}
    return BenchmarkResult(
        name='biotac20',
        measured='share of windows and slides recognised; confusion counts single windows',
        data=f'BioTac, {len(bags)} materials × 40 slides of 6 s (github dexrob/BioTac_slide_20_50, Gao et al. 2020)',
        split=f'by slide and by time: trained on slides {TRAINED} of each material, tested on {TESTED}',
        numbers={recipe: _numbers(recipe, report) for recipe, report in reports.items()},
        charts=_charts(reports, options.out),
    )


def _report(recipe: str, bags: list[Path], options: BenchmarkOptions) -> EvaluationReport:
    model = trained_once(options, f'{recipe}-{TRAINED}', lambda: train_from_bags(recipe, bags, TRAINED))
    return evaluate(model, bags, TESTED)


def _numbers(recipe: str, report: EvaluationReport) -> dict[str, Any]:
    return {'recipe': load_recipe(recipe).as_mapping(), **report.as_json()}


def _charts(reports: dict[str, EvaluationReport], out: Path) -> tuple[Path, ...]:
    where = (
        f'BioTac, {len(next(iter(reports.values())).labels)} materials, trained on slides {TRAINED}, tested on {TESTED}'
    )
    lines = {f'{recipe}: {RECIPES[recipe]}': curve(report.known) for recipe, report in reports.items()}
    tables = [
        confusion_chart(
            report.labels, report.confusion, f'{where}: single windows, {recipe}', out / f'biotac20_{recipe}.png'
        )
        for recipe, report in reports.items()
    ]
    return (evidence_chart(lines, where, out / 'biotac20_evidence.png'), *tables)
