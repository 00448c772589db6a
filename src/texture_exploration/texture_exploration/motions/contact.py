"""Whether the finger still touches the surface while it moves along it."""

from __future__ import annotations

from texture_core.errors import MotionAborted
from texture_exploration.arms.protocol import ArmState
from texture_exploration.motions.touch import TouchParams


class ContactLost(MotionAborted):
    """The finger has been off the surface for longer than is allowed."""


class ContactWatch:
    """Decide from the measured force whether the finger touches, and for how long it has not.

    A force below `lost_force_share` of the wanted one counts as no contact. Gaps up to `lost_contact_s` are bounces,
    which a rough surface causes; a longer one is a lost surface. Time is that of the arm's states, so a pause of this
    machine is no loss.

    Parameters
    ----------
    force_n
        The wanted force.
    touch
        The limits.
    """

    def __init__(self, force_n: float, touch: TouchParams) -> None:
        self._force_n = force_n
        self._least_n = touch.lost_force_share * force_n
        self._longest_s = touch.lost_contact_s
        self._lost_ns: int | None = None
        self._force_now_n = force_n

    @property
    def touching(self) -> bool:
        """Whether the newest state was one with contact."""
        return self._lost_ns is None

    def restart(self) -> None:
        """The finger was brought to the surface again."""
        self._lost_ns = None

    def update(self, arm: ArmState) -> None:
        """Take a state of the arm.

        Raises
        ------
        ContactLost
            If the contact has been lost for longer than `lost_contact_s`.
        """
        self._force_now_n = arm.force_n
        # Written so that NaN is no contact.
        if arm.force_n >= self._least_n:
            self._lost_ns = None
            return
        if self._lost_ns is None:
            self._lost_ns = arm.time_ns
        lost_s = (arm.time_ns - self._lost_ns) * 1e-9
        if lost_s >= self._longest_s:
            self.refuse(lost_s)

    def refuse(self, lost_s: float = 0.0) -> None:
        """Raise ContactLost in a sentence.

        Raises
        ------
        ContactLost
            Always.
        """
        since = f' for {lost_s * 1e3:.0f} ms' if lost_s else ''
        raise ContactLost(
            f'the contact with the surface was lost{since}: the force is {self._force_now_n:.2f} N of '
            f'{self._force_n:g} N; check that the surface goes on along the whole path, or raise '
            "'lost_contact_s' if it is rough"
        )
