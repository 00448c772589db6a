# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mapping file (YAML): which columns of tables are signals, and what labels, slides and conditions come from."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from texture_core.config import from_mapping, load_yaml, param, unknown_name
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import MAX_HZ
from texture_recordings.slides import STREAMS

FIELD = re.compile(r'\{(\w*)(:d)?\}|\*')


def template_fields(template: str, name: str) -> dict[str, str] | None:
    """Return the fields of a name, None if it is not of the form of the template; InvalidData if it fits in two ways.

    A field in braces is one character or more without '/', `{run:d}` digits alone, '*' and '{}' any text that is not
    kept.
    """
    if rest := re.search('[{}]', FIELD.sub('', template)):
        raise InvalidData(f"'{template}' has a '{rest[0]}' that belongs to no field; write {{material}} or {{run:d}}")
    # If fields that are as long as can be and such that are as short as can be are the same, there is but one way.
    found = []
    for most in ('', '?'):
        pattern, end = '', 0
        for match in FIELD.finditer(template):
            field = '[0-9]' if match[2] else '[^/]'
            pattern += f'{re.escape(template[end : match.start()])}({field}{"+" if match[1] else "*"}{most})'
            end = match.end()
        fits = re.fullmatch(pattern + re.escape(template[end:]), name, re.DOTALL)
        if not fits:
            return None
        found.append(fits.groups())
    names = [match[1] or '' for match in FIELD.finditer(template)]
    if any(names) and found[0] != found[1]:
        one, other = (', '.join(f'{key or "*"}={text}' for key, text in zip(names, fields, strict=True))
                      for fields in reversed(found))  # fmt: skip
        raise InvalidData(
            f"'{name}' fits '{template}' in two ways: {one}; or {other}; write a part that tells them apart, or "
            'digits as {code:d}, or rename the files'
        )
    return {key: text for key, text in zip(names, found[0], strict=True) if key}


UNITS = (
    '', 'count', 'g', 'm/s²', 'm/s', 'm', 'mm', 'rad/s', 'rad', 'deg', 'Pa', 'hPa', 'kPa', 'bar', 'N', 'mN', 'N m', 'T',
    'mT', 'µT', 'G', 'V', 'mV', 'A', 'mA', 'C', 'pC', 'F', 'pF', 'Ω', 'kΩ', '°C', 'K', '%',
)  # fmt: skip
SAME_UNITS = {'m/s^2': 'm/s²', 'uT': 'µT', 'Ohm': 'Ω', 'kOhm': 'kΩ'}
TIME_UNITS: Mapping[str, float] = {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9, 'min': 60.0}
# How names of columns end that name their unit: t_ms, 't (s)', 'time [us]'; in the order of TIME_UNITS.
UNIT_IN_NAME = re.compile(
    r'.*(?:[_. ]|[(\[] ?)(?:(s|sec|seconds?)|(ms|msec|milliseconds?)|([uµμ]s|usec|microseconds?)|(ns|nsec|nanoseconds?)'
    r'|(min|minutes?)) ?[)\]]?',
    re.IGNORECASE,
)
BORDERS = ('file', 'column', 'pause', 'row')


@dataclass(frozen=True)
class FileFormat:
    """How a file is read, where its kind does not say it."""

    delimiter: str = param('', "Character between columns of a text file; '' finds one of , ; tab | or space.")
    decimal: str = param(
        '',
        "Decimal sign of numbers in a text file; '' is '.', and refuses a column in which it may separate thousands.",
        choices=('', '.', ','),
    )
    skip_rows: int = param(0, 'Number of lines of a text file that are skipped at its top.', low=0, high=10_000)
    header: bool = param(True, 'Says whether a row with names of columns comes first; without, they count from 0.')
    transpose: bool = param(False, 'Says whether arrays are (n_channels, n_samples) and not (n_samples, n_channels).')


@dataclass(frozen=True)
class TimeColumn:
    """When the rows were sampled."""

    column: str = param('', "Names the column of time; '' takes rows as evenly spaced at `rate_hz`.")
    unit: str = param('s', 'Names the unit of the column of time.', choices=tuple(TIME_UNITS))

    def __post_init__(self) -> None:
        if named := UNIT_IN_NAME.fullmatch(self.column):
            unit = next(unit for unit, text in zip(TIME_UNITS, named.groups(), strict=True) if text)
            if unit != self.unit:
                raise InvalidParameter(
                    f"column '{self.column}' under `time` names {unit}, its unit is {self.unit}; write unit: {unit}, "
                    'or rename the column if its name is wrong'
                )


@dataclass(frozen=True)
class StreamColumns:
    """The columns of one stream: `signal` for vibration, `signal_static` for slow channels."""

    columns: list[str] = param(  # noqa: RUF009 – it gives a field
        [],
        "Names the columns in their order: names, patterns ('taxel*') or ranges ('0-8', 'acc.1-3'); patterns leave out "
        'columns that another key names.',
    )
    channels: list[str] = param(  # noqa: RUF009 – it gives a field
        [], 'Names the channels in the bag; [] takes the names of the columns.'
    )
    unit: str = param('', "Names the unit of the samples after scaling; '' if unknown.", choices=(*UNITS, *SAME_UNITS))
    scale: float = param(1.0, 'Factor by which samples are multiplied.')
    rate_hz: float = param(
        0.0, 'Sampling rate; 0 takes it from the column of time, or from the file.', unit='Hz', low=0.0, high=MAX_HZ
    )
    samples_per_row: int = param(
        0,
        'Number of successive columns that are consecutive samples of one channel; 0 as 1, for three columns at most '
        'that count up.',
        low=0,
        high=1_000_000,
    )
    time: TimeColumn = field(default_factory=TimeColumn)

    def __post_init__(self) -> None:
        object.__setattr__(self, 'unit', SAME_UNITS.get(self.unit, self.unit))
        if not self.scale:
            raise InvalidParameter(
                "parameter 'scale' is 0, by which all samples are 0; write another factor, such as 1"
            )


@dataclass(frozen=True)
class LabelColumn:
    """Where the surface of a slide is named."""

    column: str = param('', 'Names the column, or the field of `files` or `tables`, that holds the label.')
    value: str = param('', 'Names the label of all slides, in place of a column.')
    names: Mapping[str, str] = field(
        default_factory=dict,
        metadata={
            'description': 'Names of labels by their codes, such as {0: cork, 1: felt}; other texts stay, and other '
            'numbers are refused.'
        },
    )


@dataclass(frozen=True)
class SlideBorders:
    """Parameters that say where slides begin and end."""

    by: str = param(
        'file',
        "Says what ends a slide: 'file' (each file or table is one slide), 'column' (a value changes), 'pause' (time "
        "jumps by `pause_s`, or back) or 'row' (each row is one, see `samples_per_row`).",
        choices=BORDERS,
    )
    column: str = param('', "Names the column whose value changes between slides, for 'column'.")
    values: list[str] = param(  # noqa: RUF009 – it gives a field
        [],
        "Values of the column at which the finger slides, or patterns of them ('pass *'); [] takes all but empty ones.",
    )
    pause_s: float = param(0.5, "Shortest pause between slides, for 'pause'.", unit='s', low=0.0)
    min_s: float = param(0.2, 'Shortest slide that is kept; shorter ones are counted.', unit='s', low=0.0)


@dataclass(frozen=True)
class Quantity:
    """A number of which each slide has its mean."""

    column: str = param('', 'Names the column, or the field of `files` or `tables`, that holds the number.')
    value: str = param('', 'Number for all slides, in place of a column.')
    unit: str = param('', "Unit of the number; '' is the SI unit.")


# Where a state holds a condition, and factors of its units to that of SI.
CONDITION_COLUMNS = {'speed': 'speed_m_s', 'force': 'force_n', 'direction': 'direction_rad'}
CONDITION_UNITS: Mapping[str, Mapping[str, float]] = {
    'speed': {'m/s': 1.0, 'cm/s': 1e-2, 'mm/s': 1e-3, 'mm/min': 1e-3 / 60.0},
    'force': {'N': 1.0, 'mN': 1e-3, 'gf': 9.80665e-3, 'kgf': 9.80665},
    'direction': {'rad': 1.0, 'deg': 0.017453292519943295},
}
# Lowest and highest mean of a slide that a tactile finger reaches, in SI units.
PLAUSIBLE: Mapping[str, tuple[float, float, str]] = {
    'speed': (5e-5, 2.0, '0.05 mm/s to 2 m/s'), 'force': (1e-3, 100.0, '1 mN to 100 N'),
    'direction': (-6.3, 6.3, '-6.3 to 6.3 rad'),
}  # fmt: skip


def plausible(name: str, value: float, unit: str = '') -> float:
    """Return the mean of a condition over a slide, given in a unit; InvalidData if no finger reaches it."""
    low, high, shown = PLAUSIBLE[name]
    if low <= value <= high:
        return value
    units = CONDITION_UNITS[name]
    unit = unit or next(iter(units))
    number = value / units[unit]
    likely = [one for one, factor in units.items() if low <= number * factor <= high]
    raise InvalidData(
        f'the {name} of a slide is {number:.4g} {unit}, plausible are {shown}; leave out what is unknown, or look at '
        'its unit' + (f', which may be {" or ".join(likely)}' if likely else '')
    )


@dataclass(frozen=True)
class TableMapping:
    """Parameters that map the columns of tables to signals and slides."""

    files: str = param('*', "Gives the template of the paths below the source, such as '{material}/run{run}.csv'.")
    tables: str = param(
        '', "Gives the template of the arrays in a file that are a slide each, such as '{material}/speed{speed}'."
    )
    format: FileFormat = field(default_factory=FileFormat)
    rows: Mapping[str, str] = field(
        default_factory=dict,
        metadata={'description': 'Values of columns, such as {sensor: S1}: only rows that have them are read.'},
    )
    streams: Mapping[str, StreamColumns] = field(default_factory=dict)
    label: LabelColumn = field(default_factory=LabelColumn)
    slides: SlideBorders = field(default_factory=SlideBorders)
    conditions: Mapping[str, Quantity] = field(default_factory=dict)  # what is not named is unknown
    session: str = param('', "Names the column or field by which slides go into bags; '' makes one bag a surface.")
    sensor: str = param('', "Names the sensor in the bags; '' takes the name of the mapping file, without its ending.")
    motion: str = param('linear_slide', 'Names the motion in the bags.')

    def __post_init__(self) -> None:
        for template in (self.files, self.tables):
            names = [match[1] for match in FIELD.finditer(template) if match[1]]
            if len(set(names)) < len(names):
                raise InvalidParameter(f"the template '{template}' has a field twice; give each a different name")
        for name, quantity in self.conditions.items():
            if name not in CONDITION_UNITS:
                raise unknown_name(name, CONDITION_UNITS, 'condition')
            if quantity.unit and quantity.unit not in CONDITION_UNITS[name]:
                units = ', '.join(CONDITION_UNITS[name])
                raise InvalidParameter(f"the unit of {name} is '{quantity.unit}'; use one of {units}")
        if not self.streams or not set(self.streams) <= set(STREAMS):
            raise InvalidParameter(
                f'the streams are {", ".join(self.streams) or "none"}; name {" or ".join(STREAMS)}, or both'
            )
        for name, stream in self.streams.items():
            if not stream.columns:
                raise InvalidParameter(f"the stream '{name}' has no columns; list their names")
            if (role := self.roles().get(stream.time.column, 'time')) != 'time':
                raise InvalidParameter(
                    f"column '{stream.time.column}' is under `time` and under `{role}`; name another under one of them"
                )
        origins: Mapping[str, LabelColumn | Quantity] = {**self.conditions, 'label': self.label}
        for name, one in origins.items():
            if bool(one.column) == bool(one.value):
                came = 'both came' if one.column else 'neither came'
                raise InvalidParameter(
                    f'the {name} has a column or a value, and {came}; write {name}: {{column: NAME}}, a column or a '
                    f'field of `files`, or {name}: {{value: …}}'
                )
        if self.slides.by == 'column' and not self.slides.column:
            raise InvalidParameter('slides end where a column changes, and none is named; give `column` under `slides`')

    def roles(self) -> dict[str, str]:
        """Return the columns that are no samples by name, with the key that names them."""
        roles = {
            **{one.time.column: 'time' for one in self.streams.values()},
            **{one.column: 'conditions' for one in self.conditions.values()},
            **dict.fromkeys(self.rows, 'rows'),
            self.slides.column * (self.slides.by == 'column'): 'slides',
            self.session: 'session',
            self.label.column: 'label',
        }
        return {name: key for name, key in roles.items() if name}

    def texts(self) -> list[str]:
        """Return the names of the columns that are read as texts."""
        by_column = [self.slides.column] * (self.slides.by == 'column')
        return [name for name in (self.label.column, self.session, *by_column, *self.rows) if name]

    def numbers(self) -> list[str]:
        """Return the names of the columns that are read as numbers, beside those of the streams."""
        names = [one.time.column for one in self.streams.values()] + [one.column for one in self.conditions.values()]
        return [name for name in names if name]


def load_mapping(given: str | Path) -> TableMapping:
    """Return the mapping in a file; a sensor that it does not name has the name of the file."""
    if not (path := Path(given).expanduser()).is_file():
        fault = f"'{given}' is a folder" if path.is_dir() else f"there is no file '{given}'"
        raise InvalidParameter(f'{fault}; give a mapping (YAML), and behind it the source')
    mapping = mapping_from(load_yaml(path, 'mapping'), f"mapping '{path}'")
    return mapping if mapping.sensor else replace(mapping, sensor=path.stem)


def mapping_from(content: object, where: str = 'mapping') -> TableMapping:
    """Return the mapping that plain values describe; InvalidParameter if they are unknown or impossible."""
    return from_mapping(TableMapping, content, where)
