"""YAML of users and of strangers: plain values, each written out.

A name for a value (`&a`) that others refer to (`*a`) is refused: ten lines of such names stand for a billion values.
"""

from collections import Counter
from typing import Any

import yaml


class UnaliasedLoader(yaml.SafeLoader):  # type: ignore[misc]
    """A safe loader that knows no aliases; `loader` of `yaml.load`."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Compose a value, and refuse one that stands elsewhere.

        Raises:
            YAMLError: It is an alias.
        """
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()
            problem = f"the alias *{event.anchor}; write the value out"
            raise yaml.composer.ComposerError(None, None, problem, event.start_mark)
        node: yaml.Node | None = super().compose_node(parent, index)
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Construct names and values, and refuse a name with two of them.

        Raises:
            YAMLError: A name stands twice.
        """
        names = Counter(name.value for name, _ in node.value if isinstance(name, yaml.ScalarNode))
        for name, count in names.most_common(1):
            if count > 1:
                problem = f"{name!r} twice"
                raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark)
        values: dict[Any, Any] = super().construct_mapping(node, deep)
        return values


def read_yaml(text: str, loader: type[UnaliasedLoader] = UnaliasedLoader) -> Any:  # noqa: ANN401 - any document
    """Return the values of a YAML document.

    Args:
        text: The document.
        loader: Loader, of which a format may have its own.

    Raises:
        YAMLError: It is damaged, has aliases, a name twice, or values too deep in each other.
    """
    try:
        return yaml.load(text, loader)
    except RecursionError as error:
        raise yaml.YAMLError("values too deep in each other") from error
    except ValueError as error:  # numbers too long to read, days that are none
        raise yaml.YAMLError(str(error)) from error
