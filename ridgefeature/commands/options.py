"""Options of the command line that come from the fields of Settings: name, type, default and help."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, get_type_hints

import click

from ridgefeature.settings import Settings


class SettingsCommand(click.Command):
    """A command with one more option for each field of Settings, in a group of their own in its help."""

    def __init__(self, *args: Any, **keywords: Any) -> None:
        super().__init__(*args, **keywords)
        self.settings = _options({p.name for p in self.params})
        self.params.extend(self.settings)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The command's own options, then the settings."""
        groups: dict[bool, list[tuple[str, str]]] = {False: [], True: []}
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx)
            if record is not None and not isinstance(param, click.Argument):
                groups[param in self.settings].append(record)
        with formatter.section("Options"):
            formatter.write_dl(groups[False])
        with formatter.section("Settings (lengths are parts of the local width)"):
            formatter.write_dl(groups[True])


def settings_from(options: dict[str, Any]) -> Settings:
    """Take the options that are settings out of `options`; those not given keep their default."""
    given = {f.name: options.pop(f.name, None) for f in fields(Settings)}
    return Settings(**{name: value for name, value in given.items() if value is not None})


def _options(taken: set[str | None]) -> list[click.Parameter]:
    types = get_type_hints(Settings)
    options: list[click.Parameter] = []
    for field in fields(Settings):
        if field.name in taken:
            raise ValueError(f"the setting {field.name} has the name of another option; rename one of them")
        flag = field.name.replace("_", "-")
        kind = types[field.name]
        options.append(
            click.Option(
                [f"--{flag}/--no-{flag}" if kind is bool else f"--{flag}", field.name],
                type=kind,
                default=None,
                metavar=None if kind is bool else {int: "N", float: "X"}.get(kind, "NAME"),
                help=f"{field.metadata.get('help', '')}  [default: {field.default}]",
            )
        )
    return options
