"""Pages of the command reference, written from the command line itself."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from unbend.cli import app as command_line

if TYPE_CHECKING:
    from sphinx.application import Sphinx

# What the reference is ordered by.
SUBJECTS = {
    "One shape": ("check", "canonical", "distance", "symmetry"),
    "Two shapes": ("match", "evaluate", "transfer", "register", "morph", "similarity"),
    "Many shapes": ("collection",),
    "In a browser": ("view", "app"),
    "The rest": ("demo", "cache"),
}


def all_commands() -> Iterator[tuple[str, Any]]:
    """Every command with its full name, groups before what is in them."""
    root = typer.main.get_command(command_line)
    yield from _within(root, "unbend")


def _within(group: Any, name: str) -> Iterator[tuple[str, Any]]:
    for word, command in group.commands.items():
        yield f"{name} {word}", command
        if hasattr(command, "commands"):
            yield from _within(command, f"{name} {word}")


def page_of(name: str, command: Any) -> str:
    """Write the page of a command as Markdown."""
    context = command.context_class(command, info_name=name)
    usage = command.get_usage(context).removeprefix("Usage: ")
    text, _, examples = (command.help or "").partition("\b\nExamples:\n")
    parts = [f"# {name}", _escaped(text.strip()), f"```text\n{usage}\n```"]
    if examples:
        lines = "\n".join(line.strip() for line in examples.strip().splitlines())
        parts += ["## Examples", f"```sh\n{lines}\n```"]
    if hasattr(command, "commands"):
        words = {word: f"{name} {word}" for word in command.commands}
        rows = [(f"[{full}]({_file(full)})", _first(command.commands[word].help))
                for word, full in words.items()]  # fmt: skip
        tree = "\n".join(_file(full) for full in words.values())
        parts += [_table("command", "what it does", rows), f"```{{toctree}}\n:hidden:\n{tree}\n```"]
    for heading, kind in (("Arguments", "argument"), ("Options", "option")):
        of_kind = [one for one in command.params if one.param_type_name == kind]
        records = [one.get_help_record(context) for one in of_kind if not one.hidden]
        if records:
            rows = [(f"`{_spaced(record[0])}`", _escaped(record[1])) for record in records]
            parts += [f"## {heading}", _table(heading.lower()[:-1], "what it is", rows)]
    return "\n\n".join(parts) + "\n"


def index_page() -> str:
    """Write the page that leads to all others."""
    top = {name.split()[-1]: one for name, one in all_commands() if name.count(" ") == 1}
    parts = [
        "# Commands",
        "The commands cover the main functions; [Python](../api/index) has more of them, and more "
        "of their options. Results go to standard output or to the file of `-o`, notes and "
        "warnings to standard error. `--json` prints JSON. A mistake gives one sentence and exit "
        "code 2, and no file is left half-written. `unbend COMMAND --help` prints the same text as "
        "these pages.",
    ]
    for subject, words in SUBJECTS.items():
        rows = [(f"[unbend {word}]({_file(f'unbend {word}')})", _first(top[word].help))
                for word in words]  # fmt: skip
        parts += [f"## {subject}", _table("command", "what it does", rows)]
    tree = "\n".join(_file(f"unbend {word}") for words in SUBJECTS.values() for word in words)
    return "\n\n".join([*parts, f"```{{toctree}}\n:hidden:\n{tree}\n```"]) + "\n"


def write_pages(folder: Path) -> None:
    """Write all pages; what is right already is left alone, so that it is not built again."""
    folder.mkdir(exist_ok=True)
    pages = {"index.md": index_page()}
    pages |= {_file(name): page_of(name, command) for name, command in all_commands()}
    for old in folder.glob("*.md"):
        if old.name not in pages:
            old.unlink()
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def _file(name: str) -> str:
    return name.removeprefix("unbend ").replace(" ", "-") + ".md"


def _first(text: str | None) -> str:
    return _escaped((text or "").partition("\n\n")[0].replace("\n", " "))


def _escaped(text: str) -> str:
    """Keep what Markdown would take for its own."""
    return re.sub(r"([\\|*_<>\[\]])", r"\\\1", text)


def _spaced(text: str) -> str:
    """Set the choices of an option apart; within a table, a bar has to be escaped."""
    return re.sub(r"\s*\|\s*", r" \\| ", text.replace(" <str>", ""))


def _table(left: str, right: str, rows: list[tuple[str, str]]) -> str:
    lines = [f"| {left} | {right} |", "|---|---|", *(f"| {a} | {b} |" for a, b in rows)]
    return "\n".join(lines)


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages before Sphinx looks for them."""
    app.connect("builder-inited", lambda app: write_pages(Path(app.srcdir) / "commands"))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
