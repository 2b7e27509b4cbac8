"""A command that answers a mistyped call with what was meant."""

from __future__ import annotations

import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

import click

__all__ = ["HelpfulCommand"]

ALIKE = 0.75  # share of letters that a misspelt option has in common with the right one


class HelpfulCommand(click.Command):
    r"""A command of options alone, which leads on from an option or a word that it does not know.

    Parameters
    ----------
    leads
        What to say to options that users try in vain: `{"--gpu": "write --device cuda"}`.
    values
        What a word that stands alone looks like if an option was forgotten: `{"-o": r".*\.h5"}`.
    **others
        As for `click.Command`.
    """

    allow_extra_args = True  # to answer them

    def __init__(self, *arguments: Any, leads: Mapping[str, str], values: Mapping[str, str], **others: Any) -> None:
        super().__init__(*arguments, **others)
        self._leads = leads
        self._values = values

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments.

        Raises
        ------
        click.UsageError
            If there is one that is not known, or a value is none; the text says how to go on.
        """
        try:
            rest = super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            wrong = error.option_name
            raise click.UsageError(f"there is no option {wrong}{self._way_on(ctx, wrong)}", ctx) from error
        if rest and not ctx.resilient_parsing:
            raise click.UsageError(f"{rest[0]} stands alone{self._option_of(ctx, rest[0])}", ctx)
        return rest

    def _way_on(self, ctx: click.Context, wrong: str) -> str:
        """Return what follows after an option that is none."""
        if wrong in self._leads:
            return f"; {self._leads[wrong]}"
        known = [name for option in self.get_params(ctx) for name in option.opts if name.startswith("--")]
        begun = [name for name in known if name.startswith(wrong) and len(wrong) > len("--x")]
        meant = begun or get_close_matches(wrong.lower(), known, 1, ALIKE)
        return f"; did you mean {meant[0]}?" if meant else f"; {ctx.command_path} --help lists those there are"

    def _option_of(self, ctx: click.Context, word: str) -> str:
        """Return what follows after a word without an option."""
        if f"--{word}" in (name for option in self.get_params(ctx) for name in option.opts):
            return f"; did you mean --{word}?"
        missing = [option.opts[0] for option in self.get_params(ctx) if ctx.params.get(option.name or "") is None]
        meant = [name for name, value in self._values.items() if name in missing and re.fullmatch(value, word)]
        if not meant:
            return f", without an option before it; {ctx.command_path} --help lists the options"
        return f", without an option before it; did you mean {' or '.join(f'{name} {word}' for name in meant)}?"
