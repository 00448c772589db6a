# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Names, parameters, YAML and JSON: how a choice is looked up, a value checked and a file read within limits."""

from __future__ import annotations

import ctypes
import dataclasses
import difflib
import errno
import importlib
import io
import json
import lzma
import math
import os
import re
import stat
import sys
import tokenize
import traceback
import typing
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, BinaryIO, TypeVar, cast

import yaml

from texture_core.errors import InvalidParameter, MissingLibrary, TextureError, UnknownName

if TYPE_CHECKING:
    from texture_core.types import AnyArray

# --------------------
# Look a choice up by name: in a table of the suite, or as 'module:Class' of the user.

T = TypeVar('T')
MOST_NAMES = 100  # that a sentence lists


def find(catalogue: Mapping[str, T], name: str, kind: str) -> T:
    """Return the entry called `name`; `kind` is the noun for the error sentence, such as 'feature'.

    A name with a colon is imported: 'my_package.my_module:MyFeature'.

    Parameters
    ----------
    catalogue
        Names and what they mean.
    name
        Name that the user gave, or 'module:Class'.
    kind
        Noun for the error sentence, such as 'feature'.

    Returns
    -------
    object
        The entry, or the imported class.

    Raises
    ------
    UnknownName
        With the nearest known name.
    """
    return cast(T, _import(name, kind)) if ':' in name else look_up(catalogue, name, kind)


def look_up(catalogue: Mapping[str, T], name: str, kind: str) -> T:
    """Return the entry called `name` as `find` does, but import nothing: for a name that came over the network."""
    if name not in catalogue:
        raise unknown_name(name, catalogue, kind)
    return catalogue[name]


def unknown_name(name: str, known: Iterable[str], kind: str, most: int = MOST_NAMES) -> UnknownName:
    """Return the error for a name that is not among the known ones, with the nearest of them."""
    names = sorted(known)
    bare = {one.lstrip('-'): one for one in names}  # dashes make all options alike
    near = difflib.get_close_matches(name.lstrip('-'), bare, n=1)
    hint = f"; did you mean '{bare[near[0]]}'?" if near else '.'
    more = f', … ({len(names)})' if len(names) > most else ''
    return UnknownName(f"no {kind} '{name}'{hint} Known: {', '.join(names[:most]) or 'none'}{more}")


def _import(name: str, kind: str) -> Any:
    module, _, attribute = name.partition(':')
    parts = module.split('.')
    # Names also come from files: refuse modules of Python that act when imported.
    if parts[0] in sys.stdlib_module_names or '__main__' in parts:
        raise UnknownName(f"no {kind} '{name}': '{module}' is a module of Python itself; name a module that you wrote")
    try:
        return getattr(importlib.import_module(module), attribute)
    except TextureError:
        raise
    except Exception as error:  # any error of the user's module at its import
        place = place_of(error, module)
        if place and module not in sys.modules:  # otherwise it was imported and lacks the attribute
            raise UnknownName(f"no {kind} '{name}': its module fails with {place}; correct it there") from error
        raise UnknownName(
            f"no {kind} '{name}': {error}; write 'module:Class' of something that can be imported from PYTHONPATH"
        ) from error


def place_of(error: Exception, module: str) -> str:
    """Return type, text, file and line of an error that was raised in the package of `module`, '' if it was not."""
    if isinstance(error, SyntaxError):
        return f'{type(error).__name__}: {error.msg} ({error.filename}:{error.lineno})'
    package = module.partition('.')[0]
    places = [
        f'{frame.f_code.co_filename}:{line}'
        for frame, line in traceback.walk_tb(error.__traceback__)
        if frame.f_globals.get('__name__', '').partition('.')[0] == package
    ]
    return f'{type(error).__name__}: {error} ({places[-1]})' if places else ''


def library(name: str, purpose: str, extra: str) -> Any:
    """Return a library that does not come with the suite."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MissingLibrary(name.partition('.')[0], purpose, extra) from error


# --------------------
# Find a file that a package of the suite ships, in the source tree or in an installation, without ROS.

SOURCE_TREE = Path(__file__).resolve().parents[2]


def _prefixes() -> list[Path]:
    """Return the places of installed packages."""
    return [Path(item) for item in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if item]


def folder(package: str, name: str) -> Path:
    """Return the folder `name` ('config/recipes') of a package; the first of the places that has it."""
    places = [SOURCE_TREE / package, *(place / 'share' / package for place in _prefixes())]
    for place in places:
        if (place / name).is_dir():
            return place / name
    return places[0] / name


def shipped(package: str, subfolder: str, suffix: str = '.yaml') -> dict[str, Path]:
    """Return what all packages of this machine ship in a folder of this name, by stem.

    Any installed package may add recipes, scenes or presets by having such a folder in its share; where two have a file
    of the same name, that of `package` counts.
    """
    places = [SOURCE_TREE, *(place / 'share' for place in _prefixes())]
    others = {manifest.parent.name for place in places for manifest in place.glob('*/package.xml')} - {package}
    found = {}
    for name in (*sorted(others, reverse=True), package):  # the last one counts
        for item in sorted(folder(name, subfolder).glob(f'*{suffix}')):
            if item.is_file():  # no link of an older installation
                found[item.name.removesuffix(suffix)] = item
    return found


def find_file(name_or_path: str, package: str, subfolder: str, kind: str, suffix: str = '.yaml') -> Path:
    """Return the file a user means: a path, or the name of a file that a package ships in `subfolder`."""
    path = Path(name_or_path).expanduser()
    if path.is_file():
        return path
    known = shipped(package, subfolder, suffix)
    if name_or_path not in known and (path.suffix == suffix or len(path.parts) > 1):
        raise UnknownName(f"there is no file '{name_or_path}' in '{Path.cwd()}'; give the path of a {kind} that exists")
    if name_or_path not in known:
        raise unknown_name(name_or_path, known, kind)
    return known[name_or_path]


# Packages that are installed, and their executables.
INDEX = Path('share') / 'ament_index' / 'resource_index' / 'packages'


def prefix(package: str) -> Path:
    """Return the first prefix that holds a package; UnknownName, with the nearest package, if none does."""
    for place in _prefixes():
        if (place / INDEX / package).exists():
            return place
    raise unknown_name(package, {item.name for place in _prefixes() for item in (place / INDEX).glob('*')}, 'package')


def executable(package: str, name: str) -> Path:
    """Return the path of an executable of a package; UnknownName, with the nearest one, if there is none."""
    place = prefix(package) / 'lib' / package
    if not (place / name).is_file():
        raise unknown_name(name, {item.name for item in place.glob('*')}, f"executable of package '{package}'")
    return place / name


# --------------------
# Open and read files of any origin: regular files only, at most 1 GB of them and of what they unpack to, and no pickle.

MB = 1_000_000
MAX_FILE_BYTES = 1000 * MB
MAX_DIRECTORY_BYTES = 10 * MB  # of a zip file: some 100 000 members
ZIP_END, ZIP_END_BYTES, ZIP_COMMENT_BYTES = b'PK\x05\x06', 22, 65_536  # its last record, and the longest comment
LAST_CHARACTER = 0x10FFFF  # of Unicode; NumPy keeps 32 bits for each and compares none
# What zipfile and NumPy raise at content that is damaged, cut off or claims more than there is.
BROKEN_CONTENT = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, tokenize.TokenError, ValueError, TypeError, SyntaxError, EOFError,
    NotImplementedError, RuntimeError, MemoryError, OverflowError, LookupError, OSError,
)  # fmt: skip


class FileRefused(ValueError):
    """A file that is not read: of a kind or size that is not allowed. The sentence begins with 'it'."""


def open_regular(path: str | Path, most_bytes: int | None = MAX_FILE_BYTES) -> BinaryIO:
    """Open a regular file for reading, without waiting.

    A device is not even opened: opening a serial line may reset what is connected to it. Since the path may lead to
    another file a moment later, what was opened is examined as well.
    """
    _check_regular(os.stat(path), most_bytes)  # noqa: PTH116  # the same call as below, on a path
    number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    try:
        _check_regular(os.fstat(number), most_bytes)
        return os.fdopen(number, 'rb')
    except BaseException:
        os.close(number)
        raise


def _check_regular(status: os.stat_result, most_bytes: int | None) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(status.st_mode):
        raise FileRefused('it is a device, a named pipe or a socket; a regular file is needed')
    if most_bytes is not None and status.st_size > most_bytes:
        raise FileRefused(f'it has more than {most_bytes / MB:.3g} MB, which is the limit for such a file')


def read_bounded(path: str | Path, most_bytes: int) -> bytes:
    """Return the bytes of a regular file."""
    with open_regular(path, most_bytes) as file:
        return file.read(most_bytes)


def read_text(path: str | Path, most_bytes: int, encoding: str = 'utf-8') -> str:
    """Return the text in a regular file; see `read_bounded`, UnicodeDecodeError (a ValueError) if it is no text."""
    return read_bounded(path, most_bytes).decode(encoding)


@contextmanager
def writing(path: str | Path, other: str = 'file') -> Iterator[None]:
    """Say in one sentence, within a `with` block, that a file or folder cannot be written."""
    try:
        yield
    except OSError as error:
        raise InvalidParameter(f"'{path}' cannot be written: {error.strerror}; name another {other}") from error


def read_array(file: IO[bytes]) -> AnyArray:
    """Return the array in a stream of NumPy's format (.npy); nothing in it is run."""
    import numpy as np  # noqa: PLC0415  # takes 0.1 s, and the help of the command needs none

    try:
        array: AnyArray = np.lib.format.read_array(file, allow_pickle=False)  # type: ignore[no-untyped-call]
    except BROKEN_CONTENT as error:
        raise FileRefused(f'it has no array that can be read: {type(error).__name__}: {error}') from error
    if array.dtype.kind == 'U' and array.size and array.view(np.uint32).max(initial=0) > LAST_CHARACTER:
        raise FileRefused('it is declared as text, and contains bytes that are not characters')
    return array


class Archive:
    """The members of a zip file, such as .npz or .skops, which unpack to 1 GB at most.

    No more of a member is unpacked than the directory states, so the stated sizes are what counts.
    """

    def __init__(self, file: IO[bytes], most_bytes: int = MAX_FILE_BYTES) -> None:
        _check_directory(file)
        try:
            self._zip = zipfile.ZipFile(file)
        except BROKEN_CONTENT as error:
            raise FileRefused(f'it is not an archive that can be read: {error}') from error
        self.names = tuple(dict.fromkeys(self._zip.namelist()))
        if sum(member.file_size for member in self._zip.infolist()) > most_bytes:
            raise FileRefused(f'it unpacks to more than {most_bytes // MB} MB, which is the limit for such a file')
        # zipfile unpacks other methods without a limit.
        if any(
            member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for member in self._zip.infolist()
        ):
            raise FileRefused('it is compressed by another method than deflate; save it by numpy.savez_compressed')

    def __enter__(self) -> Archive:
        return self

    def __exit__(self, *_error: object) -> None:
        self._zip.close()

    def read(self, name: str, most_bytes: int = MAX_FILE_BYTES) -> bytes:
        """Return a member; FileRefused if it is damaged or larger than allowed, KeyError if there is none."""
        info = self._zip.getinfo(name)
        if info.file_size > most_bytes:
            raise FileRefused(f"its member '{name}' has more than {most_bytes / MB:.3g} MB")
        try:
            with self._zip.open(info) as member:
                return member.read(info.file_size + 1)  # without a size, zipfile unpacks all that there is
        except BROKEN_CONTENT as error:
            raise FileRefused(f"its member '{name}' is damaged: {error}") from error

    def array(self, name: str) -> AnyArray:
        """Return the array in a member, see `read_array`; KeyError if there is no such member."""
        return read_array(io.BytesIO(self.read(name)))


def _check_directory(file: IO[bytes]) -> None:
    """Refuse a zip file whose directory would fill the memory: zipfile reads all of it, whatever it claims to list."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - ZIP_END_BYTES - ZIP_COMMENT_BYTES))
    end = file.read()
    # As zipfile looks for the record: at the end, where no comment follows, else the last one of all.
    plain = end[-ZIP_END_BYTES:][:4] == ZIP_END and end[-2:] == b'\0\0'
    at = len(end) - ZIP_END_BYTES if plain else end.rfind(ZIP_END)
    directory_bytes = int.from_bytes(end[at + 12 : at + 16], 'little') if at >= 0 else 0
    # The larger form of the record is for archives beyond 4 GB or 65 535 members.
    if directory_bytes > MAX_DIRECTORY_BYTES or end[max(0, at - 20) : max(0, at - 16)] == b'PK\x06\x07':
        raise FileRefused(f'its list of members has more than {MAX_DIRECTORY_BYTES // MB} MB; save fewer arrays in it')


class Arrays:
    """The arrays of an .npz file by name, read one at a time; see `Archive`."""

    def __init__(self, file: IO[bytes], most_bytes: int = MAX_FILE_BYTES) -> None:
        self._archive = Archive(file, most_bytes)
        self.names = tuple(name.removesuffix('.npy') for name in self._archive.names if name.endswith('.npy'))

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def __getitem__(self, name: str) -> AnyArray:
        """Return an array; KeyError if there is none of this name, FileRefused if it is damaged or too large."""
        return self._archive.array(f'{name}.npy')


# --------------------
# Check where a command is to write, before anything is computed.


def check_outputs(outputs: Sequence[str | Path | None], inputs: Sequence[str | Path]) -> None:
    """Refuse to write over a file that is read, or into a folder that does not exist."""
    read = {_real(given) for given in inputs}
    for output in outputs:
        if output and _real(output) in read:
            raise InvalidParameter(f"'{output}' would overwrite a file that is read; name another file")
        if output and not _real(output).parent.is_dir():
            raise InvalidParameter(f"'{output}' cannot be written: its folder does not exist; make it, or name another")


def _real(path: str | Path) -> Path:
    return Path(path).expanduser().resolve()


MAX_DOMAIN = 232  # above it the ports would be


def ros_domain() -> int:
    """Return the domain of ROS in which this process communicates."""
    text = os.environ.get('ROS_DOMAIN_ID') or '0'
    if not (text.isdecimal() and int(text) <= MAX_DOMAIN):
        raise InvalidParameter(
            f"ROS_DOMAIN_ID is '{text}'; set it to a whole number from 0 to {MAX_DOMAIN}, or unset it"
        )
    return int(text)


def check_middleware() -> None:
    """Refuse a middleware of ROS that is not installed, of which rcl would end the process as it is loaded."""
    name = os.environ.get('RMW_IMPLEMENTATION', '')
    library = f'lib{name}.so'
    places = [place / 'lib' for place in _prefixes()]
    places += [Path(item) for item in os.environ.get('LD_LIBRARY_PATH', '').split(os.pathsep)]
    if not name or any((place / library).exists() for place in places):
        return
    try:
        ctypes.CDLL(library)  # one that the system finds elsewhere
    except OSError as error:
        raise InvalidParameter(
            f"RMW_IMPLEMENTATION is '{name}', which is not installed here; unset it, or install that package of ROS"
        ) from error


def ros_namespace(text: str) -> str:
    """Return a namespace of ROS as it was given; InvalidParameter if it cannot be one."""
    if not re.fullmatch(r'/?([A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?/?', text):
        raise InvalidParameter(
            f"the namespace is '{text}'; allowed are letters, digits and _, with / between names, no digit first"
        )
    return text


# --------------------
# Read YAML and JSON of any origin as plain values: nothing is run. Figures are also written as JSON here.

MAX_CHARACTERS = 100_000  # of YAML, which take 3 s at worst without aliases; the longest settings in use have a tenth
MAX_CARD_BYTES = 5 * MB
# What the parsers raise, depending on what is wrong; a value such as 2024-99-99 or !!bool x is no YAMLError.
PARSE_ERRORS = (
    yaml.YAMLError, OSError, ValueError, LookupError, AttributeError, TypeError, OverflowError, RecursionError,
)  # fmt: skip


def write_json(content: Any, path: str | Path) -> None:
    """Write figures as JSON; InvalidParameter if the file cannot be written."""
    with writing(path):
        Path(path).write_text(json.dumps(content, indent=1) + '\n', encoding='utf-8')


def load_yaml(path: Path, what: str) -> Any:
    """Return the plain values in a YAML file; `what` is the noun for the error sentence, such as 'scene'."""
    try:
        return parse_yaml(read_text(path, 4 * MAX_CHARACTERS))
    except (yaml.scanner.ScannerError, yaml.parser.ParserError) as error:
        mark = error.context_mark or error.problem_mark
        place = f'from line {mark.line + 1}, column {mark.column + 1} on, ' if mark else ''
        raise InvalidParameter(
            f"{what} '{path}' is not YAML that can be read: {place}close quotes and brackets, write ': ' behind a "
            'name, and blanks, not tabs, before it'
        ) from error
    except PARSE_ERRORS as error:
        raise InvalidParameter(f"{what} '{path}' is not YAML that can be read: {error}") from error


PARAMETER_FILE = (
    "a parameter file holds 'NODE:', below it 'ros__parameters:', below it 'NAME: VALUE', each two spaces in"
)


def parameter_sections(path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield each section of a parameter file, such as '/**/explorer', with its values; refuse what ROS cannot read."""

    def sections(content: Mapping[Any, Any], above: str = '') -> Iterator[tuple[str, Mapping[str, Any]]]:
        for name, section in content.items():
            if not isinstance(section, Mapping):
                raise InvalidParameter(f"parameter file '{path}' gives no parameters to a node; {PARAMETER_FILE}")
            if name == 'ros__parameters':
                yield above, {str(key): value for key, value in section.items()}
            else:
                yield from sections(section, f'{above}/{str(name).strip("/")}'.rstrip('/'))

    try:
        content = load_yaml(path, 'parameter file')
    except InvalidParameter as error:
        raise InvalidParameter(f'{" ".join(str(error).split())}; {PARAMETER_FILE}') from error
    # As the suite's template, a file of comments alone may give none; one that is empty was not written to its end
    blank = content is None and '#' in read_text(path, 4 * MAX_CHARACTERS)
    return sections({} if blank else {'': content})


def reaches(section: str, node: str) -> bool:
    """Return whether a section is for a node of this full name; as in ROS, * is one name, ** any number of them."""
    form = re.escape(section).replace(r'/\*\*', '(/[^/]+)*').replace(r'\*', '[^/]+')
    return bool(re.fullmatch(form, node))


def check_parameter_file(path: Path, node: str = '') -> None:
    """Refuse a file that ROS cannot read as parameters of nodes; given a full name, also a section of another node."""
    allowed = ('/**', f'/**/{node.rpartition("/")[2]}', node)
    for section, _ in parameter_sections(path):
        if node and not reaches(section, node):
            raise InvalidParameter(
                f"parameter file '{path}' has the section '{section}', which is not for node '{node}'; "
                f'allowed are {", ".join(allowed)}: correct its name, or remove it'
            )


def load_card(path: Path) -> Any:
    """Return the value of `recipe` in a model card (JSON)."""
    try:
        return load_json(path, MAX_CARD_BYTES).get('recipe')
    except PARSE_ERRORS as error:
        raise InvalidParameter(f"model card '{path}' cannot be read: {error}") from error


class _PlainLoader(yaml.SafeLoader):
    """Reads no aliases, with which 400 bytes may stand for a billion values, and no key twice: the last would count."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            event = self.get_event()  # type: ignore[no-untyped-call]
            raise ValueError(
                f"line {event.start_mark.line + 1} has the alias '*{event.anchor}'; write there what it stands for"
            )
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        lines: dict[Any, int] = {}
        for node_of_key, _ in node.value:
            key, line = self.construct_object(node_of_key, deep=True), node_of_key.start_mark.line + 1
            forms = {key, str(key)} if isinstance(key, (str, int, float)) else {(repr(key),)}  # 1, 1.0 and '1' are one
            for form in forms & set(lines):
                raise ValueError(f"the key '{key}' is in line {lines[form]} and again in line {line}; write it once")
            lines |= dict.fromkeys(forms, line)
        return super().construct_mapping(node, deep=deep)


def parse_yaml(text: str) -> Any:
    """Return the plain values in a text; one of `PARSE_ERRORS` is raised if it is no YAML, or too much of it."""
    if len(text) > MAX_CHARACTERS:
        raise ValueError(f'it has {len(text)} characters; {MAX_CHARACTERS} are allowed')
    return yaml.load(text, _PlainLoader)


class _PlainDumper(yaml.SafeDumper):
    """Writes no aliases, as none are read."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def yaml_text(content: Any) -> str:
    """Return plain values as YAML that `parse_yaml` reads."""
    return str(yaml.dump(content, Dumper=_PlainDumper, sort_keys=False, allow_unicode=True, width=120))


def load_json(path: Path, most_bytes: int) -> Any:
    """Return the plain values in a JSON file."""
    return parse_json(read_text(path, most_bytes))


def parse_json(text: str) -> Any:
    """Return the plain values in a text; ValueError if it is no JSON, or nested too deeply."""
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError('it is nested too deeply') from error


def safe_repr(value: Any) -> str:
    """Return a value as a sentence shows it, however it is nested and however many digits it has."""
    try:
        return repr(value)
    except RecursionError:
        return 'something nested too deeply'
    except ValueError:
        return 'a number of thousands of digits'


# --------------------
# A parameter exists once: as a field of a frozen dataclass with default, unit, range and description.
#
# ROS declaration (`texture_core.ros`), reading from YAML, validation and the README tables all come from
# it.

NOUNS = {bool: 'true or false', int: 'a whole number', float: 'a number', str: 'a text'}


def param(
    default: Any,
    description: str,
    *,
    unit: str = '',
    low: float | None = None,
    high: float | None = None,
    choices: Sequence[str] = (),
) -> Any:
    """Return a dataclass field with its unit, range, choices and description in the metadata.

    Parameters
    ----------
    default
        Default value; a list is copied for each instance.
    description
        Noun phrase, and what a larger value changes: "Highest speed; a higher one shortens the slide."
    unit
        Unit such as 'm/s'; '' if it has none.
    low
        Lowest allowed value; None for no limit.
    high
        Highest allowed value; None for no limit.
    choices
        Allowed texts; () for any.

    Returns
    -------
    dataclasses.Field
        With these facts in its metadata.
    """
    metadata = {'description': description, 'unit': unit, 'low': low, 'high': high, 'choices': tuple(choices)}
    if isinstance(default, list):
        return dataclasses.field(default_factory=lambda: list(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One parameter of a dataclass, as `parameters_of` lists it."""

    name: str
    type: type
    default: Any
    description: str
    unit: str
    low: float | None
    high: float | None
    choices: tuple[str, ...]

    @property
    def range_text(self) -> str:
        """The allowed values as text, '' if all are."""
        if self.choices:
            return 'one of ' + ', '.join(filter(None, self.choices))  # the description explains ''
        unit = f' {self.unit}' if self.unit else ''
        bounds = {
            (True, True): f'{self.low} to {self.high}{unit}',
            (True, False): f'at least {self.low}{unit}',
            (False, True): f'at most {self.high}{unit}',
            (False, False): '',
        }
        return bounds[self.low is not None, self.high is not None]

    def check(self, value: Any) -> Any:
        """Return the value in the parameter's type."""
        if typing.get_origin(self.type) is list:
            return self._check_list(value)
        if self.type is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value) if abs(value) <= sys.float_info.max else math.inf
        if not isinstance(value, self.type) or (self.type is not bool and isinstance(value, bool)):
            allowed = ', '.join(filter(None, (f'{NOUNS[self.type]} is needed', self.range_text)))
            raise InvalidParameter(f"parameter '{self.name}' is {safe_repr(value)}; {allowed}")
        self._check_range(value)
        return value

    def _check_list(self, values: Any) -> list[Any]:
        [kind] = typing.get_args(self.type)
        if isinstance(values, (str, Mapping)) or not isinstance(values, Iterable):
            raise InvalidParameter(f"parameter '{self.name}' is {safe_repr(values)}; a list is needed")
        each = dataclasses.replace(self, type=kind)
        return [each.check(value) for value in values]

    def _check_range(self, value: Any) -> None:
        below = self.low is not None and not value >= self.low
        above = self.high is not None and not value <= self.high
        unlisted = bool(self.choices) and value not in self.choices
        if below or above or unlisted or (isinstance(value, float) and not math.isfinite(value)):
            allowed = self.range_text or 'a finite number'
            raise InvalidParameter(f"parameter '{self.name}' is {safe_repr(value)}; allowed is {allowed}")


def parameters_of(cls: type) -> list[Parameter]:
    """Return the parameters of a dataclass in their order."""
    types = typing.get_type_hints(cls)
    listed = []
    for item in dataclasses.fields(cls):
        default = item.default_factory() if item.default_factory is not dataclasses.MISSING else item.default
        meta = {'description': '', 'unit': '', 'low': None, 'high': None, 'choices': (), **item.metadata}
        listed.append(Parameter(item.name, types[item.name], default, **meta))
    return listed


def from_mapping(cls: type[T], values: Any, where: str = '') -> T:
    """Build a parameter dataclass from a mapping (a YAML section); parameters that it lacks keep their default.

    Fields that are dataclasses, or mappings of names to these, are its sections. A number in place of a text is
    converted to text: YAML reads a column named 3 as a number.
    """
    if not (isinstance(cls, type) and dataclasses.is_dataclass(cls)):
        raise InvalidParameter(f'{where}: {cls!r} is not a class with parameters; name a dataclass')
    known = {parameter.name: parameter for parameter in parameters_of(cls)}
    place, values = f'{where}: ' if where else '', {} if values is None else values
    if not isinstance(values, Mapping):
        raise InvalidParameter(f'{place}came {safe_repr(values)}; a mapping of parameter names to values is needed')
    for name in values:
        if name not in known:
            raise InvalidParameter(f'{place}{unknown_name(str(name), known, "parameter")}')
    read = {name: _value(known[name], value, where) for name, value in values.items()}
    try:
        return cls(**read)
    except InvalidParameter as error:
        raise InvalidParameter(f'{place}{error}') from error


def _value(parameter: Parameter, value: Any, where: str) -> Any:
    kind: Any = parameter.type
    if dataclasses.is_dataclass(kind):
        return from_mapping(kind, value, f'{where}, {parameter.name}')  # type: ignore[arg-type]
    if typing.get_origin(kind) in (Mapping, dict):
        return _values_by_name(parameter, value, where)
    try:
        return parameter.check(_as_text(kind, value))
    except InvalidParameter as error:
        raise InvalidParameter(f'{where}: {error}' if where else str(error)) from error


def _values_by_name(parameter: Parameter, value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise InvalidParameter(f"{where}: '{parameter.name}' is {safe_repr(value)}; a mapping of names is needed")
    _, kind = typing.get_args(parameter.type)
    return {
        str(name): _value(dataclasses.replace(parameter, name=f'{parameter.name}, {name}', type=kind), part, where)
        for name, part in value.items()
    }


def _as_text(kind: Any, value: Any) -> Any:
    if kind is str and type(value) in (int, float):
        return str(value)
    if kind == list[str] and isinstance(value, list):
        return [_as_text(str, part) for part in value]
    return value
