"""How training examples are augmented."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param


@dataclass(frozen=True)
class Augmentation:
    """Changes of the training slides that a classifier is to tolerate.

    Speed and noise change the signals of copies of each slide. Gain and slide jitter change the features of each drawn
    example: a gain adds a constant to the logarithm of a power or an amplitude, and slide jitter adds a random multiple
    of the deviation of a training slide from the mean of its class, which is noise with the covariance that slides of
    one class have among themselves.

    Examples
    --------
    >>> Augmentation().copies, Augmentation(copies=8).speed_range  # off unless a recipe asks for copies
    (0, 0.15)
    """

    copies: int = param(
        0,
        'Number of augmented copies that are made of each training slide; 0 disables the augmentation.',
        low=0,
        high=100,
    )
    speed_range: float = param(
        0.15,
        'Largest relative change of the speed of a copy, to either side; half of the copies keep the speed they have.',
        low=0.0,
        high=1.0,
    )
    noise_range: float = param(
        0.05,
        'Largest standard deviation of the white noise added to a copy, relative to that of the slide; half of the '
        'copies stay without noise, and small values are more frequent than large ones.',
        low=0.0,
        high=10.0,
    )
    gain_range: float = param(
        1.6, 'Largest factor by which the vibration of a drawn example is amplified or attenuated.', low=1.0, high=10.0
    )
    gain_probability: float = param(0.7, 'Fraction of the drawn examples whose gain is changed.', low=0.0, high=1.0)
    slide_jitter: float = param(
        1.5,
        'Standard deviation of the factor by which a slide deviation is added to a drawn example; larger values make '
        'the classifier tolerate more drift and cost accuracy without drift.',
        low=0.0,
        high=10.0,
    )
    clean_share: float = param(
        0.43, 'Fraction of the drawn examples that are of the undisturbed slides.', low=0.0, high=1.0
    )
    disturbed_copies: int = param(
        6,
        'Number of strongly disturbed copies of each slide on which early stopping is fitted; no classifier is '
        'trained on them.',
        low=0,
        high=100,
    )
