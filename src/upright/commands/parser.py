"""How the command line is read: commands below commands, and errors that take one line."""

import argparse
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from upright.errors import UprightError, did_you_mean, require_one_of, said
from upright.support.exit_status import BAD_USE
from upright.support.numbers import whole_number
from upright.support.registry import Registry
from upright.support.terminal import visible

if TYPE_CHECKING:
    from upright.support.files import Named

READ, WRITTEN, MODEL = "read", "written", "model"
"""What may be done with the file that an argument names; the last is for NAME=VALUE, where a file
is read if the name is `model`."""


class Parser(argparse.ArgumentParser):
    """A parser whose errors take one line and name what is allowed.

    It knows what is done with each file that an argument names, and refuses to write one that the
    same command reads, or writes otherwise.
    """

    def __init__(self, **options: Any) -> None:
        options.setdefault("formatter_class", argparse.RawDescriptionHelpFormatter)
        options.setdefault("allow_abbrev", False)  # else a mistyped option is taken for another
        self.files: list[tuple[argparse.Action, str]] = []
        super().__init__(**options)

    def add_argument(self, *names: str, file: str | None = None, **form: Any) -> argparse.Action:
        """Add an argument; `file` is one of READ, WRITTEN and MODEL, if it names a file."""
        action = super().add_argument(*names, **form)
        if file is not None:
            self.files.append((action, file))
        return action

    def add_commands(
        self,
        commands: Registry[Any],
        names: Iterable[str] | None = None,
        *,
        listed_only: bool = False,
    ) -> None:
        """Add commands below this one, and import their modules.

        Parameters
        ----------
        commands
            The module of a command has a docstring, which describes the command, the first line
            being its summary; EXAMPLES, which end its help; and either SUBCOMMANDS, the registry of
            those below it, or `add_options(parser)` and `run(options)`, which returns the exit
            status.
        names
            Those to be added: all unless given.
        listed_only
            Whether the commands are only to be listed, and not to be parsed: it takes less time.
        """
        added = self.add_subparsers(metavar="COMMAND", required=True)
        for name in commands if names is None else names:
            module = commands.module(name)
            parser = added.add_parser(
                name,
                help=commands.summary(name).rstrip("."),
                description=(module.__doc__ or "").strip(),
                epilog=module.EXAMPLES,
            )
            if listed_only:
                continue
            if hasattr(module, "SUBCOMMANDS"):
                parser.add_commands(module.SUBCOMMANDS)
            else:
                module.add_options(parser)
                parser.set_defaults(command=module.run, parser=parser)

    def parse(self, arguments: Sequence[str]) -> argparse.Namespace:
        """Return the options of a command line: with `command`, its function, and its `parser`.

        A command may set the default `check`, a function that refuses options which do not go
        together; it is called with all of them.

        Raises
        ------
        UprightError
            If a file's name is not possible, or a file that is written is another of these.
        """
        options, unknown = self.parse_known_args(arguments)
        parser: Parser = vars(options).get("parser", self)
        if unknown:
            flag = unknown[0].partition("=")[0]
            hint = did_you_mean(flag, parser._option_string_actions) if flag[0:1] == "-" else ""
            parser.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        if "check" in options:
            options.check(options)
        parser.check_files(options)
        return options

    def check_files(self, options: argparse.Namespace) -> None:
        """Check the files that the options name, before anything is read or written.

        Raises
        ------
        UprightError
            If a file's name is not possible, or a file is written and also another of these.
        """
        from upright.support.files import check_name, require_apart  # help needs neither

        written: list[Named] = []
        read: list[Named] = []
        for action, use in self.files:
            name = action.option_strings[-1] if action.option_strings else str(action.metavar)
            given = getattr(options, action.dest, None)
            for text in given if isinstance(given, list) else [given]:
                if text is None or (use == MODEL and not text.startswith("model=")):
                    continue
                path = text.partition("=")[2] if use == MODEL else text
                check_name(name, path)
                (written if use == WRITTEN else read).append((name, path))
        require_apart(written, read)

    def error(self, message: str) -> NoReturn:
        """Say what is wrong, and end."""
        self.exit(BAD_USE, f"{self.prog}: error: {visible(message)} (see {self.prog} --help)\n")

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print a help or an error; unlike argparse, do not ignore that it cannot be written."""
        print(message, end="", file=file or sys.stderr)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse an unknown name in the same words as everywhere."""
        if action.choices is not None:
            name = "command" if action.dest == argparse.SUPPRESS else action.dest
            try:
                require_one_of(name, value, action.choices)
            except UprightError as error:
                self.error(str(error))


def as_whole(text: str) -> int:
    """Return the whole number that an option's text stands for."""
    try:
        return whole_number(text)
    except UprightError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def as_number(text: str) -> float:
    """Return the number that an option's text stands for."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{said(text)}; it must be a number") from None
