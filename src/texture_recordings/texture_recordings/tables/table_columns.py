"""The parts of a mapping file: how the columns of a table become signals, labels and slides."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from texture_core.errors import InvalidParameter
from texture_core.parameters import param
from texture_core.signal import MAX_HZ

TIME_UNITS: Mapping[str, float] = {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9, 'min': 60.0}
BORDERS = ('file', 'column', 'pause', 'time', 'detection')
SPACINGS = ('even', 'interpolated')


@dataclass(frozen=True)
class FileFormat:
    """How a file is read, where its kind does not say it.

    Examples
    --------
    >>> FileFormat(delimiter=';', decimal=',').header
    True
    """

    delimiter: str = param('', "Sets the character between columns of a text file; '' finds one of , ; tab | or space.")
    decimal: str = param('.', 'Sets the decimal sign of numbers in a text file.', choices=('.', ','))
    comment: str = param('#', "Lines of a text file that begin with it are skipped; '' skips none.")
    skip_rows: int = param(0, 'Number of lines of a text file that are skipped at its top.', low=0, high=10_000)
    header: bool = param(True, 'Says whether a row with names of columns comes first; without, they count from 0.')
    transpose: bool = param(False, 'Says whether arrays are (n_channels, n_samples) and not (n_samples, n_channels).')
    reshape: list[int] = param(  # noqa: RUF009 – it gives a field
        [], 'Sets the shape in which the values of an array are read, for arrays that were stored with mixed up axes.'
    )
    axes: list[int] = param(  # noqa: RUF009 – it gives a field
        [], 'Sets the order of the axes of `reshape` in which the values fill the shape of the array, all from 0.'
    )

    def __post_init__(self) -> None:
        if sorted(self.axes) != list(range(len(self.reshape))):
            raise InvalidParameter(
                f'format: reshape is {self.reshape} and axes are {self.axes}; each axis of reshape is needed once, '
                'such as reshape: [75, 6, 10] and axes: [1, 0, 2]'
            )


@dataclass(frozen=True)
class TimeColumn:
    """When the rows were sampled.

    Examples
    --------
    >>> TimeColumn('time', unit='ms').spacing
    'even'
    """

    column: str = param('', "Names the column of time; '' takes rows as evenly spaced at `rate_hz`.")
    unit: str = param('s', 'Names the unit of the column of time.', choices=tuple(TIME_UNITS))
    spacing: str = param(
        'even',
        "Says what jittering times mean: 'even' takes samples as evenly spaced between gaps, as from a device whose "
        "host stamps late; 'interpolated' believes each time and interpolates onto an even grid.",
        choices=SPACINGS,
    )
    gap: float = param(
        1.75, 'Steps of time longer than so many sampling intervals are gaps, whose samples count as lost.', low=1.1
    )


@dataclass(frozen=True)
class StreamColumns:
    """The columns of one stream: `signal` for vibration, `signal_static` for slow channels.

    Examples
    --------
    >>> StreamColumns(['accel_*'], unit='g', rate_hz=1000.0).time.gap
    1.75
    """

    columns: list[str] = param(  # noqa: RUF009 – it gives a field
        [], "Names the columns in their order: names, patterns ('taxel*') or ranges ('0-8')."
    )
    channels: list[str] = param(  # noqa: RUF009 – it gives a field
        [], 'Names the channels in the bag; [] takes the names of the columns.'
    )
    unit: str = param('', "Names the unit of the samples after scaling, such as 'g' or 'Pa'; '' if unknown.")
    scale: float = param(1.0, 'Factor by which samples are multiplied.')
    rate_hz: float = param(
        0.0, 'Sampling rate; 0 takes it from the column of time, or from the file.', unit='Hz', low=0.0, high=MAX_HZ
    )
    repair_s: float = param(
        0.0, 'Longest hole by malformed rows that is interpolated; windows over longer ones are left out.',
        unit='s', low=0.0, high=10.0,
    )  # fmt: skip
    time: TimeColumn = field(default_factory=TimeColumn)


@dataclass(frozen=True)
class LabelColumn:
    """Where the surface of a slide is named.

    Examples
    --------
    >>> LabelColumn('material', names={'0': 'cork'}).names['0']
    'cork'
    """

    column: str = param('', 'Names the column, or the field of `files` or `tables`, that holds the label.')
    value: str = param('', 'Names the label of all slides, in place of a column.')
    names: Mapping[str, str] = field(
        default_factory=dict,
        metadata={
            'description': 'Names of labels by their codes, such as {0: cork, 1: felt}; others stay as they are.'
        },
    )


@dataclass(frozen=True)
class SlideBorders:
    """Parameters that say where slides begin and end.

    Examples
    --------
    >>> SlideBorders('pause', pause_s=1.0).min_s
    0.2
    """

    by: str = param(
        'file',
        "Says what ends a slide: 'file' (each file or table is one slide), 'column' (a value changes), 'pause' (time "
        "jumps by `pause_s` or back), 'time' (every `length_s`) or 'detection' (found in the signal).",
        choices=BORDERS,
    )
    column: str = param('', "Names the column whose value changes between slides, for 'column'.")
    values: list[str] = param(  # noqa: RUF009 – it gives a field
        [],
        "Values of the column at which the finger slides, or patterns of them ('pass *'); [] takes all but empty ones.",
    )
    pause_s: float = param(0.5, "Sets the shortest pause between slides, for 'pause'.", unit='s', low=0.0)
    length_s: float = param(5.0, "Sets the length of a slide, for 'time'.", unit='s', low=0.05)
    start_s: float = param(0.0, 'Time at the start of each slide that is left out.', unit='s', low=0.0)
    end_s: float = param(0.0, 'Time at the end of each slide that is left out.', unit='s', low=0.0)
    min_s: float = param(0.2, 'Shortest slide that is kept; shorter ones are counted.', unit='s', low=0.0)
    on: float = param(
        6.0, "Sets the power over that at rest above which sliding begins, for 'detection'.", low=1.0, high=1e6
    )
    off: float = param(
        3.0, "Sets the power over that at rest below which sliding ends, for 'detection'.", low=1.0, high=1e6
    )


@dataclass(frozen=True)
class Quantity:
    """A number that holds for a slide or changes along it.

    Examples
    --------
    >>> Quantity(value='20', unit='mm/s').column
    ''
    """

    column: str = param('', 'Names the column, or the field of `files` or `tables`, that holds the number.')
    value: str = param('', 'Sets the number for all slides, in place of a column.')
    unit: str = param('', "Unit of the number; '' is the SI unit.")
