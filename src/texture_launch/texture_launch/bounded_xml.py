"""Read an XML file that is neither deep nor large, and defines no entities."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from texture_core.errors import InvalidLaunch
from texture_core.files import FileRefused, read_bounded

MAX_BYTES = 200_000  # of one file; the longest in use has 5 kB
MAX_DEPTH = 30  # of elements within each other


MAX_ELEMENTS = 5000  # in one file, and that are performed in all files together


class _BoundedTree(ElementTree.TreeBuilder):
    """Build the tree of a file that is neither deep nor large, and defines no entities."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = self._count = 0

    def start(self, tag: str, attrs: dict[str, str], /) -> Element:
        """Begin an element."""
        self._depth += 1
        self._count += 1
        if self._depth > MAX_DEPTH or self._count > MAX_ELEMENTS:
            raise FileRefused(
                f'it has more than {MAX_ELEMENTS} elements, or some more than {MAX_DEPTH} deep within each other'
            )
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> Element:
        """End an element."""
        self._depth -= 1
        return super().end(tag)

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        """Refuse what could define entities that multiply."""
        raise FileRefused('it has a DOCTYPE, which no launch file needs')


def parse_launch_file(path: Path) -> Element:
    """Return the <launch> element of a file.

    Raises
    ------
    InvalidLaunch
        If the file cannot be read, is too large, defines entities or is no launch file.
    """
    try:
        content = read_bounded(path, MAX_BYTES)
        root: Element = ElementTree.fromstring(content, ElementTree.XMLParser(target=_BoundedTree()))
    except OSError as error:
        raise InvalidLaunch(f"launch file '{path}' cannot be read: {error.strerror}") from error
    except FileRefused as error:
        raise InvalidLaunch(f"launch file '{path}' is not read: {error}") from error
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # the last two: of its encoding
        raise InvalidLaunch(f"launch file '{path}' is not well-formed XML: {error}") from error
    if root.tag != 'launch':
        raise InvalidLaunch(f"launch file '{path}' begins with <{root.tag}>; <launch> is needed")
    return root
