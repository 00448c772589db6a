"""Check the docstrings: `python tools/check_docstrings.py [FOLDER]` ends with 1 and names what is missing.

A public function explains itself in numpydoc where its name and annotations cannot:

- three parameters or more: a section Parameters that names each of them, and Returns if something is returned;
- arrays among its parameters or as its result: these stand in Parameters and Returns, with their shapes and units;
- an exception that it raises itself: a section Raises that names it.

What carries out a protocol or overrides a base class of the suite (same name, same parameters) is described there,
once; it names only the exceptions that are not named there. So is a function that fills a table: it is named in an
assignment of a module, and its parameters are those of the `__call__` of a protocol, which describes them; a leading
underscore marks a parameter that it does not use.

Private names, tests, `__init__` and other special methods are left out: the parameters of a constructor stand in the
docstring of its class.

A public class of the packages in `WITH_EXAMPLES` has a doctest, or another class of its module uses it in one. A
protocol has none, for nothing can be made of it, and neither has what needs ROS; `make test` runs them all.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[1]
MANY = 3
ARRAY = re.compile(r'\b(Array|Samples|AnyArray|NDArray|ndarray|Mask)\b')
HEADING = re.compile(r'^(\w[\w ]*)\n-{3,}$', re.MULTILINE)
WITH_EXAMPLES = ('texture_features', 'texture_estimation', 'texture_recordings')
EXAMPLE = re.compile(r'^\s*(?:>>>|\.\.\.) (.*)$', re.MULTILINE)
# 'FILE:FUNCTION' → why its docstring needs no such sections.
EXCEPTIONS: Mapping[str, str] = {}

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class PublicFunction:
    """A function or method that others may call, with the class and the file in which it stands."""

    path: Path
    node: Function
    owner: ast.ClassDef | None = None

    @property
    def name(self) -> str:
        """Give its name, after the class and a dot if it is a method."""
        return f'{self.owner.name}.{self.node.name}' if self.owner else self.node.name

    @property
    def arguments(self) -> list[ast.arg]:
        """List its parameters, but for the first one of a method."""
        spec = self.node.args
        listed = [*spec.posonlyargs, *spec.args]
        bound = self.owner is not None and 'staticmethod' not in self.decorators
        return [*listed[bound:], *filter(None, [spec.vararg]), *spec.kwonlyargs, *filter(None, [spec.kwarg])]

    @property
    def decorators(self) -> set[str]:
        """Give the names of its decorators."""
        return {ast.unparse(decorator).split('(')[0] for decorator in self.node.decorator_list}

    @property
    def is_property(self) -> bool:
        """Say whether it is read as an attribute, so that its first sentence says what it is."""
        return bool(self.decorators & {'property', 'cached_property', 'functools.cached_property'})

    @property
    def result(self) -> str:
        """Give the annotation of what it returns, '' for nothing."""
        text = ast.unparse(self.node.returns) if self.node.returns else ''
        return '' if text in {'None', 'NoReturn', 'Never'} else text


@dataclass
class Tree:
    """All public functions of a folder, and what its protocols and base classes declare.

    `declared` and `protocols` hold, for each method as `signature` gives it, the text of its section Raises.
    """

    functions: list[PublicFunction] = field(default_factory=list)
    declared: dict[str, dict[str, str]] = field(default_factory=dict)  # name of a class → its methods
    protocols: dict[str, str] = field(default_factory=dict)  # the methods of protocols
    in_tables: set[str] = field(default_factory=set)  # the names of functions in tables

    def described_elsewhere(self, function: PublicFunction) -> str | None:
        """Return what the type of its table, a protocol or a base class says it raises; None if none describes it."""
        if function.owner is None:
            in_table = function.node.name in self.in_tables
            return self.protocols.get(signature(function, '__call__')) if in_table else None
        if _is_protocol(function.owner):
            return None
        bases = [ast.unparse(base).split('[')[0].split('.')[-1] for base in function.owner.bases]
        described = [self.protocols, *(self.declared.get(base, {}) for base in bases)]
        wanted = signature(function)
        found = [methods[wanted] for methods in described if wanted in methods]
        return '\n'.join(found) if found else None


def signature(function: PublicFunction, name: str = '') -> str:
    """Return what two methods share that do the same: the name, or another one, and the names of the parameters."""
    return f'{name or function.node.name}({", ".join(argument.arg.lstrip("_") for argument in function.arguments)})'


def _is_protocol(node: ast.ClassDef) -> bool:
    return any(ast.unparse(base).split('[')[0].endswith('Protocol') for base in node.bases)


def read_tree(folder: Path) -> Tree:
    """Read the Python files below a folder, without tests and set-up files."""
    tree = Tree()
    for path in sorted(folder.rglob('*.py')):
        if 'test' in path.relative_to(folder).parts or path.name == 'setup.py' or path.name.startswith('test_'):
            continue
        _read_file(path, tree)
    return tree


def _read_file(path: Path, tree: Tree) -> None:
    for node in ast.parse(path.read_text(encoding='utf-8')).body:
        if isinstance(node, Function) and not node.name.startswith('_'):
            tree.functions.append(PublicFunction(path, node))
        elif isinstance(node, ast.Assign | ast.AnnAssign) and node.value:
            tree.in_tables |= {item.id for item in ast.walk(node.value) if isinstance(item, ast.Name)}
        elif isinstance(node, ast.ClassDef):
            public = {'__call__'} if _is_protocol(node) else set()
            methods = [
                PublicFunction(path, item, node)
                for item in node.body
                if isinstance(item, Function) and (not item.name.startswith('_') or item.name in public)
            ]
            declared = {signature(method): _raises(method) for method in methods}
            tree.declared.setdefault(node.name, {}).update(declared)
            if _is_protocol(node):
                for method, text in declared.items():
                    tree.protocols[method] = f'{tree.protocols.get(method, "")}\n{text}'
            if not node.name.startswith('_'):
                tree.functions += methods


def _raises(function: PublicFunction) -> str:
    return sections(ast.get_docstring(function.node) or '').get('Raises', '')


def sections(docstring: str) -> dict[str, str]:
    """Return the text below each heading of a numpydoc docstring."""
    parts = HEADING.split(docstring)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def raised(node: Function) -> set[str]:
    """Return the names of the exceptions that a function raises itself; one that is raised again has no name."""
    found = set()
    for item in _own_nodes(node):
        if isinstance(item, ast.Raise) and item.exc is not None:
            exception = item.exc.func if isinstance(item.exc, ast.Call) else item.exc
            name = ast.unparse(exception).split('.')[-1]
            if name[0].isupper():
                found.add(name)
    return found


def _own_nodes(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what stands in a function, not what stands in functions within it."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, (*Function.__args__, ast.ClassDef, ast.Lambda)):
            yield child
            yield from _own_nodes(child)


def faults(function: PublicFunction, tree: Tree) -> list[str]:
    """Return what the docstring of one function lacks, each in a few words."""
    found = sections(ast.get_docstring(function.node) or '')
    missing = []
    elsewhere = tree.described_elsewhere(function)
    if not function.is_property and elsewhere is None:
        missing += [f'Parameters: {name}' for name in _undescribed(function, found.get('Parameters', ''))]
        if _needs_returns(function) and not {'Returns', 'Yields'} & set(found):
            missing.append('Returns')
    text = f'{found.get("Raises", "")}\n{elsewhere or ""}'
    missing += [f'Raises: {name}' for name in sorted(raised(function.node)) if not re.search(rf'\b{name}\b', text)]
    return missing


def _undescribed(function: PublicFunction, text: str) -> list[str]:
    """Return the parameters that must be described and are not."""
    many = len(function.arguments) >= MANY
    needed = [argument.arg for argument in function.arguments if many or _is_array(argument.annotation)]
    return [name for name in needed if not re.search(rf'^[\w*, ]*\b{name}\b[\w*, ]*( :|$)', text, re.MULTILINE)]


def _needs_returns(function: PublicFunction) -> bool:
    """Say whether the result must be described: it is an array, or comes from many parameters or from arrays."""
    many = len(function.arguments) >= MANY
    return bool(function.result) and (many or bool(ARRAY.search(function.result)))


def _is_array(annotation: ast.expr | None) -> bool:
    return annotation is not None and bool(ARRAY.search(ast.unparse(annotation)))


def classes_without_example(path: Path) -> list[str]:
    """Return the public classes of a module that no doctest in it shows."""
    text = path.read_text(encoding='utf-8')
    shown = ' '.join(EXAMPLE.findall(text))
    classes = [node for node in ast.parse(text).body if isinstance(node, ast.ClassDef) and not _is_protocol(node)]
    return [
        node.name
        for node in classes
        if not node.name.startswith('_')
        and not EXAMPLE.search(ast.get_docstring(node) or '')
        and not re.search(rf'\b{node.name}\b', shown)
    ]


def check_examples(folder: Path) -> list[str]:
    """Return one sentence for each public class without an example."""
    paths = [path for name in WITH_EXAMPLES for path in sorted(folder.glob(f'{name}/{name}/**/*.py'))]
    return [
        f"{path}: the class '{name}' has no example; show in a doctest what it does"
        for path in paths
        if not {'nodes', 'ros'} & set(path.parts)
        for name in classes_without_example(path)
    ]


def check(folder: Path) -> list[str]:
    """Return one sentence for each docstring that lacks something, in the order of the files."""
    tree = read_tree(folder)
    found = []
    for function in tree.functions:
        place = f'{function.path}:{function.node.lineno}'
        missing = faults(function, tree)
        if missing and f'{function.path.name}:{function.name}' not in EXCEPTIONS:
            found.append(f"{place}: the docstring of '{function.name}' lacks {'; '.join(missing)}")
    return found


def main() -> int:
    """Check a folder and print which docstrings lack what."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument('folder', type=Path, nargs='?', default=ROOT / 'src', help='source tree to check')
    folder = parser.parse_args().folder
    found = check(folder)
    print('\n'.join(found) or 'all docstrings say what a caller needs')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
