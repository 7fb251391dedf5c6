"""Words on the terminal: errors as one line with an exit status, warnings as one line, tables, JSON."""

from __future__ import annotations

import json
import math
import re
import sys
import warnings
from collections.abc import Iterable
from typing import Any, NoReturn

import click

from ridgefeature.commands import interrupts

BAD_INPUT, NO_RIDGE, INTERRUPTED = 2, 3, interrupts.STATUS


class Program(click.Group):
    """A click group whose every failure is one line on stderr: 2 bad input, 3 no ridge, 130 interrupted."""

    def main(self, *args: Any, **options: Any) -> NoReturn:
        options["standalone_mode"] = False
        with interrupts.heard(), warnings.catch_warnings():
            if not sys.warnoptions:
                warnings.simplefilter("ignore")
                warnings.filterwarnings("always", category=UserWarning)
            warnings.showwarning = self._show_warning
            sys.exit(self._status(*args, **options))

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; an interrupt is caught before click makes two lines of it."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            return fail(interrupts.told(), INTERRUPTED)

    def _status(self, *args: Any, **options: Any) -> int:
        try:
            interrupts.check()
            result = super().main(*args, **options)
        except (click.Abort, KeyboardInterrupt):
            return fail(interrupts.told(), INTERRUPTED)
        except Exception as error:
            # What fails once an interrupt has come fails by it.
            return fail(interrupts.told(), INTERRUPTED) if interrupts.came() else self._failed(error)
        status = result if isinstance(result, int) else 0
        return fail(interrupts.told(), INTERRUPTED) if interrupts.came() and status == 0 else status

    def _failed(self, error: Exception) -> int:
        """Say why in one line; returns the exit status, raises what is no failure of the user's."""
        if isinstance(error, click.exceptions.NoArgsIsHelpError):
            click.echo(error.format_message())
            return 0
        if isinstance(error, click.UsageError):
            return fail(usage(error, self._options()), BAD_INPUT)
        if isinstance(error, click.ClickException):
            return fail(error.format_message(), BAD_INPUT)
        if isinstance(error, OSError):
            return fail(_reason(error), BAD_INPUT)
        if isinstance(error, ValueError):
            from ridgefeature import NoRidgeError

            status = NO_RIDGE if isinstance(error, NoRidgeError) else BAD_INPUT
            return fail(self._in_options(str(error)), status)
        raise error

    def _in_options(self, message: str) -> str:
        return in_options(message, {str(o.name) for _, o in self._options()})

    def _show_warning(self, message: Warning | str, *_: Any, **__: Any) -> None:
        click.echo(f"ridgefeature: warning: {one_line(self._in_options(str(message)))}", err=True)

    def _options(self) -> list[tuple[str, click.Option]]:
        """The options of all commands, with the command of each."""
        pairs = [(name, p) for name, command in self.commands.items() for p in command.params]
        return [(name, p) for name, p in pairs if isinstance(p, click.Option)]


def in_options(message: str, names: Iterable[str]) -> str:
    """The message with Python's words for options, `name:` to begin with and `name=`, as --name."""
    some = "|".join(sorted(names, key=len, reverse=True))

    def option(match: re.Match[str]) -> str:
        return f"--{match[1].replace('_', '-')}"

    message = re.sub(rf"^(?:setting )?({some})(?=:)", option, message)
    return re.sub(rf"(?<![\w-])({some})=(?=[\s,;.)]|$)", option, message)


def usage(error: click.UsageError, options: list[tuple[str, click.Option]]) -> str:
    """What click says of a wrong command line, with what was expected and where all of it is told."""
    said = error.format_message().rstrip(".")
    if isinstance(error, click.NoSuchOption) and error.possibilities:
        return said
    where = "" if error.ctx is None else error.ctx.command_path
    option = getattr(error, "param", None)
    if isinstance(error, click.BadOptionUsage):
        # click's parser does not tell which command it was.
        command, option = next(pair for pair in options if error.option_name in pair[1].opts)
        where = where or f"ridgefeature {command}"
    if isinstance(option, click.Option) and isinstance(option.metavar, str) and option.help:
        several = ", apart by spaces" if option.nargs > 1 else ""
        said += f"; expected {option.opts[-1]} {option.metavar}{several}: {one_line(option.help).rstrip('.')}"
    return f"{said}; {where} --help tells all"


def fail(message: str, status: int) -> int:
    """Say why on stderr, in one line; returns the exit status."""
    click.echo(f"ridgefeature: {one_line(message)}", err=True)
    return status


def one_line(text: str) -> str:
    """The text with every run of white space made one space."""
    return " ".join(text.split())


def print_json(document: dict[str, Any]) -> None:
    """One JSON object on stdout; null for numbers that JSON cannot write."""
    click.echo(json.dumps(_plain(document), indent=1, allow_nan=False))


def print_table(title: str, rows: Iterable[tuple[str, str]]) -> None:
    """Two columns on stdout, names and values."""
    rows = list(rows)
    if not sys.stdout.isatty():
        # A script wants whole lines, and nothing that takes time to import.
        breadth = max(len(name) for name, _ in rows)
        click.echo("\n".join([title, *(f"{name:<{breadth}}  {value}" for name, value in rows)]))
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title), title_justify="left", show_header=False, box=None, pad_edge=False)
    table.title_style = "bold"
    table.add_column(style="cyan", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in rows:
        table.add_row(Text(name), Text(value))
    Console(highlight=False).print(table)


def point(values: Iterable[float]) -> str:
    """Coordinates to read and to paste behind --at."""
    return " ".join(f"{value:.6g}" for value in values)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _reason(error: OSError) -> str:
    """Python's own errors say the number first and the file last; the file matters most."""
    if error.strerror and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return str(error)
