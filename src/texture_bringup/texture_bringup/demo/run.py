"""The demonstration from beginning to end."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from texture_bringup.demo.bench import DemoBench
from texture_bringup.demo.picture import draw
from texture_bringup.demo.plan import Plan
from texture_bringup.demo.results import Row, latencies_s, table
from texture_bringup.demo.story import Story
from texture_core.errors import InvalidData
from texture_evaluation.commands import train as training
from texture_evaluation.commands.evaluate import percent
from texture_evaluation.evaluate import Report, evaluate_bags
from texture_evaluation.train import train_from_bags

SOURCE = 'simulated Robotiq TSF-85'


@dataclass(frozen=True)
class Places:
    """What the demonstration leaves behind, in one folder."""

    folder: Path

    @property
    def learning_bag(self) -> Path:
        """Recording of the slides learnt from."""
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


def demonstrate(out: Path, recipe: str, seed: int, plan: Plan, story: Story) -> bool:
    """Explore, learn, recognise and report on the emulator; return whether every slide was recognised."""
    places = Places(out)
    places.clear()
    story.chapter('Starting the emulator: simulated surfaces, arm and sensor; the other nodes are the real ones')
    with (
        tempfile.TemporaryDirectory(prefix='texture_demo_') as folder,
        DemoBench(Path(folder), places.log, recipe, seed) as bench,
    ):
        story.line('5 nodes run, and the sensor delivers 1000 samples a second')
        _learn(bench, places, plan, story)
        _train(places, recipe, story)
        bench.use_model(places.model.resolve())
        story.line('the running classifier has taken the model over')
        rows = _recognise(bench, places, plan, story)
    report = _report(rows, places, plan, story)
    return all(row.right for row in rows) and len(report.known) == len(rows)


def _learn(bench: DemoBench, places: Places, plan: Plan, story: Story) -> None:
    story.chapter(f'Learning: {plan.learning_slides} slides over each of {len(plan.surfaces)} simulated surfaces')
    with bench.recording(places.learning_bag):
        for surface in plan.surfaces:
            story.part(f'{surface:<18}', first=True)
            for number, _ in enumerate(bench.explore(surface, plan.requests(surface, plan.learning_slides)), start=1):
                story.part(f'{", " * (number > 1)}slide {number}')
            story.part(' recorded', last=True)


def _train(places: Places, recipe: str, story: Story) -> None:
    story.chapter('Training on that recording (the same as `texture train`)')
    model = train_from_bags(recipe, [places.learning_bag], out=places.model)
    for line in training.summary(model, places.model):
        story.line(line)


def _recognise(bench: DemoBench, places: Places, plan: Plan, story: Story) -> list[Row]:
    story.chapter('Recognising: new slides at other places; each ends as soon as the classifier is certain')
    rows = []
    with bench.recording(places.recognition_bag):
        for surface in plan.surfaces:
            story.part(f'{surface:<18}', first=True)
            felt = bench.explore(surface, plan.requests(surface, plan.recognition_slides, early_stopping=True))
            for number, explored in enumerate(felt):
                rows.append(Row(surface, explored.texture))
                story.part(f'{", " if number else "felt as "}{explored.texture.label or "nothing"}')
            story.part('', last=True)
    return rows


def _report(rows: list[Row], places: Places, plan: Plan, story: Story) -> Report:
    story.chapter('Result')
    latencies: Mapping[str, float] = latencies_s(places.recognition_bag)
    for line in table(rows, latencies):
        story.line(line)
    right = sum(row.right for row in rows)
    story.line(f'{right} of {len(rows)} slides over simulated surfaces recognised')
    story.line('latency: from the last sample of a window to its estimate at another process')
    report = evaluate_bags(places.model, [places.recognition_bag])
    report.write(places.figures)
    windows = percent(report.as_json()['window_accuracy'])
    story.line(f'`texture evaluate` reads the same recording: {windows} of single windows right')
    draw(places.recognition_bag, plan.shown, report, SOURCE, places.picture)
    story.chapter(f'Done. Look at {places.picture}')
    story.line(f'recordings, model, figures and the log of the nodes are in {places.folder}/')
    return report
