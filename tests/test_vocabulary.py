"""One word for one thing: names and docstrings of the source, read as text."""

import ast
import re
from collections import Counter
from collections.abc import Iterator

import pytest

from tests.syntax_trees import ROOT, SHIPPED, source_files

Definition = ast.ClassDef | ast.FunctionDef

# Words for which the field has another one: detect, observation, image, min_, confirmed, required, cluster, similarity ...
OTHER_WORDS = re.compile(
    r"(?:^|_)(?:sights?|looks?(?!_up)|looked|looker|pictures?|plain|least(?!_squares)|most|anew|told|believed|wanted|judged?|judges"
    r"|answers?|answered|things?|candidates?(?!_pairs)|likeness|strengths?|disturbances?|carriers?|descent|begun|shaken|accuses)(?:_|$)"
)
# An entry that is a noun phrase or a sentence: it begins with a capital, a number, a symbol or a shape.
WHOLE_ENTRY = re.compile(r"[A-Z0-9(`'\"\[\u0370-\u03ff].*", re.DOTALL)


def definitions(*packages: str) -> Iterator[tuple[str, Definition]]:
    for path, nodes in source_files(*packages):
        for node in nodes:
            if isinstance(node, Definition):
                yield str(path.relative_to(ROOT)), node


def words_of(name: str) -> str:
    """Return CamelCase as snake_case."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def field_entries(docstring: str) -> Iterator[tuple[str, str]]:
    """Yield name and text of each entry below `Args:` and `Attributes:`."""
    for section in re.findall(r"^(?:Args|Attributes):\n((?:(?: {4}.*)?\n?)*)", docstring, re.M):
        yield from re.findall(r"^ {4}(\w+): ((?:.*\n?)(?: {8}.*\n?)*)", section, re.M)


def test_a_public_class_name_has_one_meaning():
    public = Counter(
        node.name
        for path, node in definitions()
        if isinstance(node, ast.ClassDef)
        and not node.name.startswith("_")
        and not path.startswith("benchmarks/")
    )
    assert [name for name, count in public.items() if count > 1] == []


def test_names_are_the_standard_terms():
    odd = [
        f"{path}: {node.name}"
        for path, node in definitions(*SHIPPED, "tests")
        if OTHER_WORDS.search(words_of(node.name))
    ]
    assert odd == []


def test_entries_of_docstrings_read_alone():
    fragments = [
        f"{path}: {node.name}: {name}: {text.strip()}"
        for path, node in definitions()
        for name, text in field_entries(ast.get_docstring(node) or "")
        if not WHOLE_ENTRY.fullmatch(text) or not text.strip().endswith((".", ")"))
    ]
    assert fragments == []


@pytest.mark.parametrize(
    ("name", "is_odd"),
    [
        ("min_score", False),
        ("least_score", True),
        ("LookUp", False),
        ("FirstLook", True),
        ("Overlook", False),
    ],
)
def test_a_word_is_found_only_as_a_whole(name, is_odd):
    assert bool(OTHER_WORDS.search(words_of(name))) is is_odd


def test_a_fragment_would_be_seen():
    docstring = "Do it.\n\nArgs:\n    config: of the pipeline\n    seed: Seed of\n        noise.\n"
    entries = dict(field_entries(docstring))
    assert entries == {"config": "of the pipeline\n", "seed": "Seed of\n        noise.\n"}
    assert [bool(WHOLE_ENTRY.fullmatch(text)) for text in entries.values()] == [False, True]
