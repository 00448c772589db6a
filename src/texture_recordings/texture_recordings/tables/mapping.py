"""What a mapping file (YAML) says: which columns are signals, and what labels, slides and conditions come from."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from texture_core.errors import InvalidParameter
from texture_core.parameter_tree import tree_from_mapping
from texture_core.parameters import param
from texture_core.plain_data import load_yaml
from texture_core.resources import find_file
from texture_core.signal import MAX_HZ, MIN_HZ
from texture_recordings.slides import STREAMS

FIELD = re.compile(r'\{(\w*)\}|\*')
ANYTHING = ''


@dataclass(frozen=True)
class NameTemplate:
    """A name with fields in braces; '*' and '{}' stand for any text that is not kept.

    A field is one character or more, holds no '/', and ends where the text behind it in the template comes first. So
    no name takes long to compare.

    Parameters
    ----------
    text
        The template; its parts between slashes are compared one by one.

    Raises
    ------
    InvalidParameter
        If two fields follow each other without text between them, or a name occurs twice.

    Examples
    --------
    >>> NameTemplate('{material}/{speed}mms_*.csv').match('felt/20mms_first.csv')
    {'material': 'felt', 'speed': '20'}
    """

    text: str

    def __post_init__(self) -> None:
        names = [name for name in self.names if name]
        if len(set(names)) < len(names):
            raise InvalidParameter(f"the template '{self.text}' has a field twice; give each a name of its own")
        for part in self.text.split('/'):
            if '' in FIELD.sub('\0', part).split('\0')[1:-1]:
                raise InvalidParameter(f"the template '{self.text}' has fields without text between; put text there")

    @property
    def names(self) -> Sequence[str]:
        """Names of the fields in their order, '' for those that are not kept."""
        return [match[1] or ANYTHING for match in FIELD.finditer(self.text)]

    @property
    def depth(self) -> int:
        """Number of parts between slashes."""
        return self.text.count('/') + 1

    def match(self, name: str) -> dict[str, str] | None:
        """Return the fields of a name; None if it is not of this form."""
        parts = name.split('/')
        if len(parts) != self.depth:
            return None
        found: dict[str, str] = {}
        for template, part in zip(self.text.split('/'), parts, strict=True):
            fields = _fields(template, part)
            if fields is None:
                return None
            found |= fields
        return found


def _fields(template: str, text: str) -> Mapping[str, str] | None:
    names = [match[1] or ANYTHING for match in FIELD.finditer(template)]
    first, *literals = FIELD.sub('\0', template).split('\0')
    if not literals:
        return {} if text == template else None
    last = literals[-1]
    at, end = len(first), len(text) - len(last)
    if not text.startswith(first) or not text.endswith(last):
        return None
    found = {}
    for name, literal in zip(names, [*literals[:-1], None], strict=True):
        shortest = 1 if name else 0
        stop = end if literal is None else text.find(literal, at + shortest, end)
        if stop < at + shortest:
            return None
        if name:
            found[name] = text[at:stop]
        at = stop + len(literal or '')
    return found


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

    def __post_init__(self) -> None:
        if 0.0 < self.rate_hz < MIN_HZ:
            raise InvalidParameter(
                f"parameter 'rate_hz' is {self.rate_hz:g}; allowed are 0 and {MIN_HZ:g} to {MAX_HZ:g}"
            )


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


# Factor to the SI unit, by the name of the condition.
CONDITION_UNITS: Mapping[str, Mapping[str, float]] = {
    'speed': {'m/s': 1.0, 'cm/s': 1e-2, 'mm/s': 1e-3},
    'force': {'N': 1.0, 'mN': 1e-3, 'gf': 9.80665e-3, 'kgf': 9.80665},
    'direction': {'rad': 1.0, 'deg': 0.017453292519943295},
}


@dataclass(frozen=True)
class ConditionQuantities:
    """How the finger slid; what is not named is unknown."""

    speed: Quantity = field(default_factory=Quantity)
    force: Quantity = field(default_factory=Quantity)
    direction: Quantity = field(default_factory=Quantity)

    def __post_init__(self) -> None:
        for name, units in CONDITION_UNITS.items():
            quantity = getattr(self, name)
            if quantity.unit and quantity.unit not in units:
                raise InvalidParameter(f"the unit of {name} is '{quantity.unit}'; use one of {', '.join(units)}")
            try:
                float(quantity.value or 0.0)
            except ValueError as error:
                raise InvalidParameter(f"the {name} is '{quantity.value}'; write a number, such as 0.05") from error


@dataclass(frozen=True)
class TableMapping:
    """Parameters that map the columns of tables to signals and slides.

    Examples
    --------
    >>> mapping = mapping_from({'streams': {'signal': {'columns': ['ax']}}, 'label': {'column': 'material'}})
    >>> mapping.slides.by, mapping.streams['signal'].columns
    ('file', ['ax'])
    >>> mapping.format == FileFormat(), mapping.label == LabelColumn('material'), mapping.slides == SlideBorders()
    (True, True, True)
    >>> mapping.streams['signal'] == StreamColumns(['ax'])
    True
    >>> mapping.conditions == ConditionQuantities(speed=Quantity())  # unknown
    True
    """

    files: str = param('*', "Gives the template of the paths below the source, such as '{material}/run{run}.csv'.")
    tables: str = param(
        '', "Gives the template of the arrays in a file that are a slide each, such as '{material}/speed{speed}'."
    )
    format: FileFormat = field(default_factory=FileFormat)
    streams: Mapping[str, StreamColumns] = field(default_factory=dict)
    label: LabelColumn = field(default_factory=LabelColumn)
    slides: SlideBorders = field(default_factory=SlideBorders)
    conditions: ConditionQuantities = field(default_factory=ConditionQuantities)
    session: str = param('', "Names the column or field by which slides go into bags; '' makes one bag a surface.")
    sensor: str = param('imported', 'Names the sensor in the bags.')
    motion: str = param('linear_slide', 'Names the motion in the bags.')
    max_malformed: float = param(
        0.1, 'Largest fraction of malformed rows of a file; one with more is refused.', low=0.0, high=1.0
    )

    def __post_init__(self) -> None:
        for template in filter(None, (self.files, self.tables)):
            NameTemplate(template)
        if not self.streams or not set(self.streams) <= set(STREAMS):
            raise InvalidParameter(
                f'the streams are {", ".join(self.streams) or "none"}; name {" or ".join(STREAMS)}, or both'
            )
        for name, stream in self.streams.items():
            if not stream.columns:
                raise InvalidParameter(f"the stream '{name}' has no columns; list their names")
        if bool(self.label.column) == bool(self.label.value):
            raise InvalidParameter('the label has not one origin; give `column` or `value` under `label`')
        if self.slides.by == 'column' and not self.slides.column:
            raise InvalidParameter('slides end where a column changes, and none is named; give `column` under `slides`')


def load_mapping(name_or_path: str | Path) -> TableMapping:
    """Return the mapping in a file, or one that the package ships in config/mappings, by name.

    Raises
    ------
    UnknownName, InvalidParameter
        If there is no such file, or it contains something unknown or impossible.
    """
    path = find_file(str(name_or_path), 'texture_recordings', 'config/mappings', 'mapping')
    return mapping_from(load_yaml(path, 'mapping'), f"mapping '{path}'")


def mapping_from(content: object, where: str = 'mapping') -> TableMapping:
    """Return the mapping that plain values describe; InvalidParameter if they are unknown or impossible."""
    return tree_from_mapping(TableMapping, content, where)
