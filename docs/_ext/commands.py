"""The directive ``commands``: the help of every command, asked of the commands themselves."""

import re
from collections.abc import Iterator

import click
from docutils import nodes
from package import FromPackage
from sphinx.application import Sphinx

from chuteflow.cli.program import chuteflow as program

#: An option in a sentence.
_OPTION = re.compile(r"(--[a-z][\w-]*)")


class Commands(FromPackage):
    """One section for each command."""

    def run(self) -> list[nodes.Node]:
        """The sections."""
        self.note_package()
        context = click.Context(program, info_name="chuteflow")
        return [self._section(name, context) for name in program.list_commands(context)]

    def _section(self, name: str, parent: click.Context) -> nodes.section:
        group = parent.command
        assert isinstance(group, click.Group)
        command = group.get_command(parent, name)
        assert command is not None
        context = click.Context(command, info_name=name, parent=parent)
        title = context.command_path
        section = nodes.section(ids=[title.replace(" ", "-")], names=[title])
        section += nodes.title(title, title)
        section += _prose(command.help or "")
        usage = command.get_usage(context).removeprefix("Usage: ")
        section += nodes.literal_block(usage, usage, language="text")
        section += self._options(command, context)
        for paragraph in (command.epilog or "").split("\n\n"):
            section += _example(paragraph) if paragraph.startswith("Example: ") else _prose(paragraph)
        if isinstance(command, click.Group):
            section += [self._section(part, context) for part in command.list_commands(context)]
        return section

    def _options(self, command: click.Command, context: click.Context) -> nodes.definition_list:
        listed = nodes.definition_list()
        for written, help_ in _records(command, context):
            item, meaning = nodes.definition_list_item(), nodes.definition()
            item += nodes.term("", "", nodes.literal(written, written))
            meaning += _prose(help_)
            item += meaning
            listed += item
        return listed


def _records(command: click.Command, context: click.Context) -> Iterator[tuple[str, str]]:
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record and "--help" not in parameter.opts:
            yield record


def _prose(text: str) -> nodes.paragraph:
    """A paragraph with options as literals, whose two hyphens are not to become a dash."""
    paragraph = nodes.paragraph(text)
    for i, part in enumerate(_OPTION.split(text)):
        paragraph += nodes.literal(part, part) if i % 2 else nodes.Text(part)
    return paragraph


def _example(paragraph: str) -> nodes.literal_block:
    line = paragraph.removeprefix("Example: ")
    return nodes.literal_block(line, line, language="sh")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True}
