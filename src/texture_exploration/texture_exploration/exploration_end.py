"""How the end of an exploration is reported to the operator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from texture_exploration.exploration import ExplorationOutcome

STILL_MOVING = ExplorationOutcome(
    False, 'the explorer ended before the finger was lifted; look at the robot', slid=False, lifted=False
)


@dataclass(frozen=True)
class ExplorationEnd:
    """The end of an exploration.

    Attributes
    ----------
    exploration_id
        Id of the exploration.
    outcome
        How it ended.
    """

    exploration_id: str
    outcome: ExplorationOutcome

    @property
    def severity(self) -> Literal['info', 'warning', 'error']:
        """Level of the log: an abort is a warning, a finger that was not lifted is an error."""
        if self.outcome.success:
            return 'info'
        return 'warning' if self.outcome.lifted else 'error'

    @property
    def sentence(self) -> str:
        """What the log says."""
        lifted = '' if self.outcome.success or not self.outcome.lifted else '; the finger was lifted'
        return f'{self.exploration_id}: {self.outcome.message}{lifted}'
