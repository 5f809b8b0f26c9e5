"""YAML of users and of strangers: plain values, each written out.

A name for a value (`&a`) that others refer to (`*a`) is refused: ten lines of such names stand for a billion values.
"""

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


def read_yaml(text: str, loader: type[UnaliasedLoader] = UnaliasedLoader) -> Any:  # noqa: ANN401 - any document
    """Return the values of a YAML document.

    Args:
        text: The document.
        loader: Loader, of which a format may have its own.

    Raises:
        YAMLError: It is damaged, has aliases, or values too deep in each other.
    """
    try:
        return yaml.load(text, loader)
    except RecursionError as error:
        raise yaml.YAMLError("values too deep in each other") from error
    except ValueError as error:  # numbers too long to read, days that are none
        raise yaml.YAMLError(str(error)) from error
