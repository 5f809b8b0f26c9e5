"""What is declared is imported, and what is imported is declared."""

import ast
import re
import sys
import tomllib
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

from tests.syntax_trees import ROOT, SHIPPED, source_files

OURS = (*SHIPPED, "tests")
# Declared and not imported: programs and plugins that the Makefile calls, and what torch.onnx, Sphinx and build load.
CALLED = {
    "ruff": "/ruff check",
    "mypy": "/mypy",
    "pytest-xdist": "pytest -n auto",
    "sphinx": "-m sphinx",
    "build": "-m build",
    "twine": "/twine check",
    "mutmut": "/mutmut run",
}
LOADED_BY_OTHERS = {"onnxscript", "myst-parser", "furo", "hatchling", "s3fs"}
# Imported under another name; those that are installed say so themselves.
DISTRIBUTIONS = {
    "PIL": "pillow",
    "cv2": "opencv-python-headless",
    "sklearn": "scikit-learn",
    "yaml": "pyyaml",
}


def normalized(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def declared() -> dict[str, set[str]]:
    """Return the names that each group of dependencies declares."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    groups = {"": project["dependencies"], **project["optional-dependencies"]}
    return {
        group: {normalized(re.match(r"[\w.-]+", line).group()) for line in lines} - {"trifuse"}
        for group, lines in groups.items()
    }


@cache
def imported(*folders: str) -> dict[str, Path]:
    """Return the distributions that files import, each with one of the files."""
    installed = packages_distributions()
    found = {}
    for path, nodes in source_files(*folders):
        for node in nodes:
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
                names = [node.module]
            for top in {name.partition(".")[0] for name in names}:
                if top not in sys.stdlib_module_names and top not in OURS:
                    name = DISTRIBUTIONS.get(top) or installed.get(top, [top])[0]
                    found[normalized(name)] = path
    return found


def test_what_is_imported_is_declared():
    names = set().union(*declared().values())
    assert {name: path for name, path in imported(*OURS).items() if name not in names} == {}


def test_what_is_declared_is_imported():
    names = set().union(*declared().values())
    assert names - imported(*OURS).keys() - CALLED.keys() - LOADED_BY_OTHERS == set()


def test_what_is_declared_as_a_program_is_called():
    makefile = (ROOT / "Makefile").read_text()
    assert [name for name, words in CALLED.items() if words not in makefile] == []


def test_perception_imports_what_is_always_installed():
    assert imported("perception").keys() - declared()[""] == set()


def test_tests_import_no_package_that_only_the_benchmark_needs():
    groups = declared()
    needed = set().union(*(names for group, names in groups.items() if group != "bench"))
    assert imported("tests").keys() - needed == set()


def test_documents_of_the_wheel_keep_their_places():
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]
    places = build["targets"]["wheel"]["shared-data"]
    assert all((ROOT / source).exists() for source in places)
    # Links between them hold as in the source tree.
    assert {place: f"share/doc/trifuse/{place}" for place in places} == places
