"""What docs/security.md promises of the code: nothing in it could run what a file holds."""

import ast
from collections.abc import Iterator
from functools import cache

import pytest

from data.folder.typed_document import read_document
from data.results.command_config import read_config
from perception.errors import DriveError, UsageError
from perception.sensor import load_sensor
from perception.yaml_text import read_yaml
from tests.faults import fault
from tests.syntax_trees import ROOT, source_files

# They run code when they are read.
UNSAFE_MODULES = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"}
# Values between a process and one that it has started, through a pipe.
BETWEEN_OWN_PROCESSES = {"data/synthetic/remote_object.py", "data/results/process_writer.py"}
SAFE_LOADERS = {"perception/yaml_text.py"}


@cache
def calls() -> list[tuple[str, str, ast.Call]]:
    """Return file, dotted name and node of every call in what ships."""
    return [
        (path, ast.unparse(node.func), node)
        for path, nodes in shipped()
        for node in nodes
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute)
    ]


def shipped() -> Iterator[tuple[str, tuple[ast.AST, ...]]]:
    """Yield file and syntax nodes of everything that ships."""
    for path, nodes in source_files():
        yield path.relative_to(ROOT).as_posix(), nodes


def keyword(call: ast.Call, name: str) -> str | None:
    return next((ast.unparse(one.value) for one in call.keywords if one.arg == name), None)


def test_no_file_is_unpickled():
    importing = set()
    for path, nodes in shipped():
        for node in nodes:
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if UNSAFE_MODULES & {name.partition(".")[0] for name in names}:
                importing.add(path)
    assert importing == BETWEEN_OWN_PROCESSES


def test_xml_is_parsed_in_one_place_which_refuses_document_types():
    importing = {
        path
        for path, nodes in shipped()
        for node in nodes
        if isinstance(node, ast.Import | ast.ImportFrom) and "xml" in ast.unparse(node).split()[1]
    }
    assert importing == {"data/kitti360/storage.py"}
    assert "StartDoctypeDeclHandler" in (ROOT / "data/kitti360/storage.py").read_text()


def test_numbers_and_weights_are_read_as_data():
    faults = []
    for path, name, call in calls():
        if name in ("np.load", "numpy.load") and keyword(call, "allow_pickle") != "False":
            faults.append(f"{path}: {name}")
        if name == "torch.load" and keyword(call, "weights_only") != "True":
            faults.append(f"{path}: {name}")
    assert faults == []


def test_yaml_is_read_by_the_one_loader():
    names = ("yaml.load", "yaml.safe_load", "yaml.full_load", "yaml.unsafe_load", "yaml.load_all")
    assert {path for path, name, _ in calls() if name in names} == SAFE_LOADERS


def test_no_text_is_run():
    assert [path for path, name, _ in calls() if name in ("eval", "exec", "os.system")] == []
    assert [path for path, _, call in calls() if keyword(call, "shell") == "True"] == []


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("a: &a [1]\nb: *a", "the alias \\*a"),
        ("a: &a {b: 1}\nc:\n  <<: *a", "the alias \\*a"),
        ("a: 1\nb: 2\na: 3", "'a' twice"),
        ("[" * 5000, "too deep"),
        ("a: " + "9" * 5000, "4300 digits"),
        ("!!python/object/apply:os.system ['true']", "could not determine a constructor"),
    ],
    ids=["alias", "merge", "twice", "deep", "long number", "code"],
)
def test_yaml_of_a_stranger_is_values_alone(text, problem):
    from yaml import YAMLError

    with pytest.raises(YAMLError, match=problem):
        read_yaml(text)


BOMB = "\n".join(
    ["a0: &a0 [1]", *(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 40))]
)


def test_few_lines_do_not_stand_for_many_values(tmp_path):
    path = tmp_path / "bomb.yaml"
    path.write_text(BOMB)
    with fault(UsageError, where=str(path), found="the alias *a0"):
        read_config(path)
    with fault(UsageError, where=str(path), found="the alias *a0"):
        load_sensor(str(path))
    with fault(DriveError, where=str(path), found="the alias *a0"):
        read_document(dict, path)
