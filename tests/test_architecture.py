"""Data flows one way: imports too, between layers and between files."""

import ast
import subprocess
import sys
from collections.abc import Collection, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from tests.syntax_trees import ROOT, nodes_of, source_files

# Lowest first; a module may import its own layer and the layers below it.
LAYERS = [
    {
        "perception.types",
        "perception.errors",
        "perception.sensor",
        "perception.atomic_file",
        "perception.snapshot",
        "perception.json_text",
        "perception.yaml_text",
    },
    {"perception.kernels"},
    {"perception.geometry"},
    {"perception.localization"},
    {"perception.obstacles", "perception.datmo", "perception.maps", "perception.tracking"},
    {"perception.calibration"},
    {"perception.detection"},
    {"perception.health"},
    {"perception.pipeline", "perception.evaluation", "perception.render"},
    {"data"},
    {"train"},
    {"export"},
    {"perception.cli"},
    {"benchmarks"},
]
OUTSIDE_THE_LAYERS = {"perception", "perception.__main__"}


def layer_of(module: str) -> int | None:
    for level, names in enumerate(LAYERS):
        if any(module == name or module.startswith(name + ".") for name in names):
            return level
    return None


def imports_of(path: Path) -> list[str]:
    names = []
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names += [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            raise AssertionError(f"{path}: relative import")
    return names


def source_modules() -> dict[str, Path]:
    found = {}
    for path, _ in source_files():
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        found[module.removesuffix(".__init__")] = path
    return found


def file_of(name: str, modules: Collection[str]) -> str:
    """Return the module that holds an imported name, a package for its `__init__`; or ``""``."""
    while name and name not in modules:
        name = name.rpartition(".")[0]
    return name


def circle(imports: Mapping[str, Collection[str]]) -> list[str]:
    """Return modules that import one another in a circle, of all imported names by module."""
    graph = {
        module: {file_of(name, imports) for name in names} - {module, ""}
        for module, names in imports.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_every_module_has_a_layer():
    homeless = [m for m in source_modules() if layer_of(m) is None]
    assert sorted(homeless) == sorted(OUTSIDE_THE_LAYERS)


def test_imports_go_one_way():
    upward = []
    for module, path in source_modules().items():
        if module in OUTSIDE_THE_LAYERS:
            continue
        for name in imports_of(path):
            target = layer_of(name)
            if target is not None and target > layer_of(module):
                upward.append(f"{module} imports {name}")
    assert upward == []


def test_no_files_import_one_another_in_a_circle():
    imports = {module: imports_of(path) for module, path in source_modules().items()}
    assert circle(imports) == []


def test_a_circle_would_be_seen(tmp_path):
    (tmp_path / "a.py").write_text("def late():\n    from shapes import Box\n")
    (tmp_path / "__init__.py").write_text("from shapes.box import Box\n")
    (tmp_path / "box.py").write_text(
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import a\n"
    )
    files = {"a": "a.py", "shapes": "__init__.py", "shapes.box": "box.py"}
    imports = {module: imports_of(tmp_path / name) for module, name in files.items()}
    assert set(circle(imports)) == {"a", "shapes", "shapes.box"}
    assert circle({**imports, "shapes.box": []}) == []


def test_contracts_are_imported_from_their_package():
    by_file = [
        f"{module} imports {name}"
        for module, path in source_modules().items()
        if not module.startswith("perception.types")
        for name in imports_of(path)
        if name.startswith("perception.types.") and name.count(".") > 2
    ]
    assert by_file == []


def test_an_upward_import_would_be_seen():
    assert layer_of("perception.geometry.se3") < layer_of("perception.obstacles.ground")
    assert (
        layer_of("perception.pipeline")
        < layer_of("data.kitti.raw")
        < layer_of("perception.cli.run")
    )


def test_the_runtime_loads_no_torch():
    code = (
        "import sys, perception, perception.pipeline, perception.cli.main\n"
        "print([m for m in ('torch', 'lightning', 'matplotlib', 'av') if m in sys.modules])"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert ran.stdout.strip() == "[]", ran.stderr
