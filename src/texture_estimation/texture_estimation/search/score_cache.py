"""What was scored is remembered, and kept in a file: a search that is run again goes on where it ended."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.errors import InvalidData, InvalidParameter
from texture_core.files import MB
from texture_core.plain_data import load_json
from texture_estimation.search.racing import EMPTY, HalfScores
from texture_estimation.search.variables import Individual

FORMAT = 1
MAX_BYTES = 50 * MB  # of a checkpoint; a search of 10 000 individuals writes 10


@dataclass
class ScoreCache:
    """Scores of the individuals met so far.

    A search is a function of its seed and of the scores. So a checkpoint holds the scores alone: begun again with the
    same seed, the search finds them all remembered, and arrives within a second at the generation it had reached.

    Parameters
    ----------
    identity
        What the scores belong to: data, halves, variables. Scores of another identity are refused.

    Examples
    --------
    >>> cache = ScoreCache({'recipe': 'mine'})
    >>> cache.store((3,), HalfScores.of([(1.0, 0.8)]))
    >>> cache.get((3,)).halves
    1
    """

    identity: Mapping[str, Any]
    records: dict[Individual, HalfScores] = field(default_factory=dict)
    hits: int = 0

    def get(self, individual: Individual) -> HalfScores:
        """Return what is known of an individual, EMPTY if nothing is."""
        return self.records.get(individual, EMPTY)

    def store(self, individual: Individual, record: HalfScores) -> None:
        """Remember scores."""
        if record.halves >= self.records.get(individual, EMPTY).halves:
            self.records[individual] = record

    def save(self, path: str | Path) -> None:
        """Write the checkpoint; a reader never sees half a file.

        Raises
        ------
        InvalidParameter
            If the file cannot be written.
        """
        target = Path(path).expanduser()
        content = {
            'format': FORMAT,
            'identity': dict(self.identity),
            'scores': [
                {'individual': list(individual), 'learning': record.learning.tolist(), 'test': record.test.tolist()}
                for individual, record in self.records.items()
            ],
        }
        beside = target.with_name(f'.{target.name}.{os.getpid()}')
        try:
            beside.write_text(json.dumps(content) + '\n', encoding='utf-8')
            beside.replace(target)
        except OSError as error:
            raise InvalidParameter(
                f"the checkpoint cannot be written to '{target}': {error.strerror}; name another file"
            ) from error
        finally:
            beside.unlink(missing_ok=True)

    def load(self, path: str | Path) -> None:
        """Remember what a checkpoint holds.

        Raises
        ------
        InvalidData
            If it cannot be read, or belongs to other data, another search space or another seed.
        """
        try:
            content = load_json(Path(path).expanduser(), MAX_BYTES)
            identity = dict(content['identity']) if content['format'] == FORMAT else None
            records = {
                tuple(entry['individual']): HalfScores(
                    np.array(entry['learning'], float), np.array(entry['test'], float)
                )
                for entry in content['scores']
            }
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InvalidData(
                f"checkpoint '{path}' cannot be read: {error}; give a file that 'texture optimise' has written"
            ) from error
        differing = [name for name, value in self.identity.items() if not identity or identity.get(name) != value]
        if differing:
            raise InvalidData(
                f"checkpoint '{path}' belongs to another search (other {', '.join(differing)}); "
                'give the same recipe, bags and options as then, or start again without it'
            )
        self.records.update(records)
