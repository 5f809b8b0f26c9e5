"""The source as syntax trees, each file parsed once for all tests of a process."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
SHIPPED = ("perception", "data", "train", "export", "benchmarks")


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """Return all nodes of a file's syntax tree, outer ones first."""
    return tuple(ast.walk(ast.parse(path.read_text())))


def source_files(*folders: str) -> Iterator[tuple[Path, tuple[ast.AST, ...]]]:
    """Yield the path and the nodes of every file of some folders, else of all that ship."""
    for folder in folders or SHIPPED:
        for path in sorted((ROOT / folder).rglob("*.py")):
            yield path, nodes_of(path)
