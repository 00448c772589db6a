"""The demonstration from beginning to end."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from texture_bringup.demo.picture import draw
from texture_bringup.demo.plan import DemoPlan
from texture_bringup.demo.progress_log import ProgressLog
from texture_bringup.demo.results import RecognisedSlide, is_refused, latencies_s, table, untrained_figures
from texture_bringup.demo.rig import DemoRig
from texture_core.errors import InvalidData
from texture_core.estimates import TextureEstimate
from texture_core.plain_data import write_json
from texture_estimation.model import load_model
from texture_evaluation.commands import train as training
from texture_evaluation.evaluate import EvaluationReport, evaluate
from texture_evaluation.evaluation_text import percent
from texture_evaluation.train import train_from_bags


@dataclass(frozen=True)
class Places:
    """What the demonstration leaves behind, in one folder."""

    folder: Path

    @property
    def learning_bag(self) -> Path:
        """Recording of the training slides."""
        return self.folder / 'learning_bag'

    @property
    def recognition_bag(self) -> Path:
        """Recording of the slides recognised, with the estimates made then."""
        return self.folder / 'recognition_bag'

    @property
    def model(self) -> Path:
        """The trained model, without its endings."""
        return self.folder / 'model'

    @property
    def picture(self) -> Path:
        """The picture."""
        return self.folder / 'demo.png'

    @property
    def figures(self) -> Path:
        """What `texture evaluate --json` writes."""
        return self.folder / 'evaluation.json'

    @property
    def log(self) -> Path:
        """What the nodes said."""
        return self.folder / 'nodes.log'

    def clear(self) -> None:
        """Make the folder; remove what an earlier demonstration has left there, and nothing else.

        Raises
        ------
        InvalidData
            If the folder cannot be written.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            for bag in (self.learning_bag, self.recognition_bag):
                shutil.rmtree(bag, ignore_errors=True)
            for file in (self.picture, self.figures, self.log):
                file.unlink(missing_ok=True)
            for ending in ('.skops', '.json'):
                self.model.with_suffix(ending).unlink(missing_ok=True)
        except OSError as error:
            raise InvalidData(f"'{self.folder}' cannot be used: {error.strerror}; name another with --out") from error


def demonstrate(out: Path, recipe: str, seed: int, plan: DemoPlan, progress: ProgressLog) -> bool:
    """Explore, learn, recognise and report on the emulator; return whether all was recognised that was trained.

    Parameters
    ----------
    out
        Folder of recordings, model, figures and picture.
    recipe
        Name of the recipe.
    seed
        Of the surfaces and places.
    plan
        Surfaces, slides and numbers.
    progress
        Takes what is printed.

    Returns
    -------
    bool
    """
    places = Places(out)
    places.clear()
    progress.section('Starting the emulator: simulated surfaces, arm and sensor; the other nodes are the real ones')
    with (
        tempfile.TemporaryDirectory(prefix='texture_demo_') as folder,
        DemoRig(Path(folder), places.log, recipe, seed) as rig,
    ):
        progress.line('5 nodes run, and the sensor delivers 1000 samples a second')
        _learn(rig, places, plan, progress)
        _train(places, recipe, progress)
        rig.use_model(places.model.resolve())
        progress.line('the running classifier has taken the model over')
        rows = _recognise(rig, places, plan, progress)
        untrained = _explore_untrained(rig, plan, progress)
    report = _report(rows, untrained, places, plan, progress)
    return all(row.right for row in rows) and len(report.known) == len(rows) and is_refused(untrained)


def _learn(rig: DemoRig, places: Places, plan: DemoPlan, progress: ProgressLog) -> None:
    progress.section(f'Learning: {plan.learning_slides} slides over each of {len(plan.surfaces)} simulated surfaces')
    with rig.recording(places.learning_bag):
        for surface in plan.surfaces:
            progress.part(f'{surface:<18}', first=True)
            for number, _ in enumerate(rig.explore(surface, plan.requests(surface, plan.learning_slides)), start=1):
                progress.part(f'{", " * (number > 1)}slide {number}')
            progress.part(' recorded', last=True)


def _train(places: Places, recipe: str, progress: ProgressLog) -> None:
    progress.section('Training on that recording (the same as `texture train`)')
    model = train_from_bags(recipe, [places.learning_bag], out=places.model)
    for line in training.summary(model, places.model):
        progress.line(line)


def _recognise(rig: DemoRig, places: Places, plan: DemoPlan, progress: ProgressLog) -> list[RecognisedSlide]:
    progress.section('Recognising: new slides at other places; each may end as soon as the classifier is certain')
    rows = []
    with rig.recording(places.recognition_bag):
        for surface in plan.surfaces:
            progress.part(f'{surface:<18}', first=True)
            measured = rig.explore(surface, plan.requests(surface, plan.recognition_slides, early_stopping=True))
            for number, explored in enumerate(measured):
                rows.append(RecognisedSlide(surface, explored.texture))
                progress.part(f'{", " if number else "recognised as "}{explored.texture.label or "nothing"}')
            progress.part('', last=True)
    return rows


def _explore_untrained(rig: DemoRig, plan: DemoPlan, progress: ProgressLog) -> TextureEstimate:
    speed, usual = plan.untrained_speed_m_s, plan.speed_m_s
    progress.section(f'Outside the training: {plan.shown} again, at {speed:g} m/s instead of {usual:g} m/s')
    [explored] = rig.explore(plan.shown, iter([plan.untrained_request()]))
    estimate: TextureEstimate = explored.texture
    progress.line(f'the estimate says: {estimate.message or "nothing"}')
    progress.line('the surface counts as unknown, and the slide is not ended early')
    return estimate


def _report(
    rows: list[RecognisedSlide], untrained: TextureEstimate, places: Places, plan: DemoPlan, progress: ProgressLog
) -> EvaluationReport:
    progress.section('Result')
    latencies: Mapping[str, float] = latencies_s(places.recognition_bag)
    for line in table(rows, latencies):
        progress.line(line)
    right = sum(row.right for row in rows)
    progress.line(f'{right} of {len(rows)} slides over simulated surfaces recognised')
    progress.line('latency: from the last sample of a window to its estimate at another process')
    model = load_model(places.model)
    report = evaluate(model, [places.recognition_bag])
    figures = {**report.as_json(), 'untrained_speed': untrained_figures(untrained, plan.untrained_speed_m_s)}
    write_json(figures, places.figures)
    windows = percent(report.as_json()['window_accuracy'])
    progress.line(f'`texture evaluate` reads the same recording: {windows} of single windows right')
    refusal = f'The same surface at {plan.untrained_speed_m_s:g} m/s: {untrained.message}'
    note = '\n'.join(filter(None, [model.error_bound.reason, refusal]))
    draw(places.recognition_bag, plan.shown, model, report, places.picture, note=note)
    progress.section(f'Done. Look at {places.picture}')
    progress.line(f'recordings, model, figures and the log of the nodes are in {places.folder}/')
    return report
