"""What a mapping file (YAML) says: which columns are signals, and what labels, slides and conditions come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from texture_core.errors import InvalidParameter
from texture_core.parameter_tree import tree_from_mapping
from texture_core.parameters import param
from texture_core.plain_data import load_yaml
from texture_core.resources import find_file
from texture_recordings.slides import STREAMS
from texture_recordings.tables.name_template import NameTemplate
from texture_recordings.tables.table_columns import FileFormat, LabelColumn, Quantity, SlideBorders, StreamColumns

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
