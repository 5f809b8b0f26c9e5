"""The configuration of a command: what `config.yaml` holds is what `--config` reads."""

import difflib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from perception import __version__
from perception.errors import UsageError

# Section of a JSON report that holds the configuration.
SECTION = "configuration"
_MAX_NAMED = 3  # unknown keys that an error names


@dataclass(frozen=True)
class CommandConfig:
    """Effective values of a command's arguments and flags, but for those that name its outputs.

    Attributes:
        command: Words that call the command, such as `run`.
        values: Value of each argument and flag by name; a dataclass is a section.
    """

    command: str
    values: Mapping[str, object]

    def text(self) -> str:
        """Return the configuration as YAML."""
        from data.results.documents import yaml_text

        return yaml_text(self.values)

    def write(self, folder: Path) -> None:
        """Write `config.yaml` into a folder of results; its first line names the command."""
        from perception.atomic_file import write_atomically

        text = f"# trifuse {__version__}: {self.command}\n{self.text()}"
        write_atomically(folder / "config.yaml", text.encode())


def read_config(path: Path) -> dict[str, Any]:
    """Read the flags of a `config.yaml`, or those that a JSON report was made with.

    Raises:
        UsageError: The file cannot be read, or holds no names and values.
    """
    import yaml

    from perception.json_text import read_json_text
    from perception.yaml_text import UnaliasedLoader, read_yaml

    def read_int(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int | str:
        # 0000 is the name of a sequence, and not an octal number.
        is_name = node.value[0] == "0" and node.value.isdigit() and len(node.value) > 1
        value: int | str = node.value if is_name else loader.construct_yaml_int(node)
        return value

    loader = type("ConfigLoader", (UnaliasedLoader,), {})
    yaml.add_constructor("tag:yaml.org,2002:int", read_int, loader)
    try:
        text = path.read_text()
        document = read_json_text(text) if path.suffix == ".json" else read_yaml(text, loader)
    except OSError as error:
        raise _unreadable(path, str(error.strerror)) from error
    except (ValueError, yaml.YAMLError) as error:
        raise _unreadable(path, " ".join(str(error).split())) from error
    if document is None:
        return {}
    if not isinstance(document, dict):
        raise _unreadable(path, f"a {type(document).__name__}")
    configuration: dict[str, Any] = document.get(SECTION, document)
    return configuration


def read_known(path: Path, command: str, known: Collection[str]) -> dict[str, Any]:
    """Read a configuration of which every key is a flag of a command.

    Args:
        path: YAML file, or JSON report.
        command: Words that call the command.
        known: Full names of its flags, nested ones with dots.

    Raises:
        UsageError: The file cannot be read, or holds keys that are no flags, such as those of another version.
    """
    configuration = read_config(path)
    unknown = [*_unknown_keys(configuration, known)]
    if unknown:
        named = ", ".join(unknown[:_MAX_NAMED])
        more = f" and {len(unknown) - _MAX_NAMED} more" if len(unknown) > _MAX_NAMED else ""
        near = difflib.get_close_matches(unknown[0], known, n=1)
        raise UsageError(
            f"--config {path}",
            expected=f"keys that are flags of {command}" + "".join(f", such as {n}" for n in near),
            found=f"{named}{more}",
            advice="remove these keys; a parameter of an older version may be a constant of the method now",
        )
    return configuration


def _unknown_keys(
    values: Mapping[str, object], known: Collection[str], section: str = ""
) -> Iterator[str]:
    for key, value in values.items():
        name = f"{section}{key}"
        is_section = any(one.startswith(f"{name}.") for one in known)
        if isinstance(value, Mapping) and is_section:
            yield from _unknown_keys(value, known, f"{name}.")
        elif name not in known and not is_section:
            yield name


def _unreadable(path: Path, found: str) -> UsageError:
    return UsageError(
        f"--config {path}", expected="a YAML file of flags and their values", found=found
    )
