"""How soon the recipe with a discriminant for the first window recognises recorded materials, on later slides."""

from __future__ import annotations

from texture_benchmarks.charts import evidence_chart
from texture_benchmarks.imported_data import imported
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_estimation.recipe import load_recipe
from texture_evaluation.evaluate import evaluate
from texture_evaluation.metrics import curve
from texture_evaluation.train import train_from_bags

RECIPE = 'onset'
TRAINED, TESTED = '1-30', '31-40'
QUICK_SLIDES = '1-6,31-32'
QUICK_TRAINED, QUICK_TESTED = '1-6', '7-8'
QUICK_MATERIALS = ('material01', 'material02', 'material03')


MEASURED = (
    'share of windows and slides recognised, after how long slides end that end as soon as they are certain, and time '
    'from window to estimate (µs)'
)


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on the first 30 slides of each material, test on the last 10."""
    slides, materials = (QUICK_SLIDES, QUICK_MATERIALS) if options.quick else ('', ())
    trained, tested = (QUICK_TRAINED, QUICK_TESTED) if options.quick else (TRAINED, TESTED)
    with imported(options, 'biotac20', slides, materials) as bags:
        report = evaluate(train_from_bags(RECIPE, bags, trained), bags, tested)
    where = f'BioTac, {len(bags)} materials, trained on slides {TRAINED}, tested on {TESTED}'
    return BenchmarkResult(
        name='onset',
        measured=MEASURED,
        data=f'BioTac, {len(bags)} materials × 40 slides of 6 s (github dexrob/BioTac_slide_20_50, Gao et al. 2020)',
        split=f'by slide and by time: trained on slides {TRAINED} of each material, tested on {TESTED}',
        numbers={RECIPE: {'recipe': load_recipe(RECIPE).as_mapping(), **report.as_json()}},
        charts=(evidence_chart({RECIPE: curve(report.known)}, where, options.out / 'onset.png'),),
    )
