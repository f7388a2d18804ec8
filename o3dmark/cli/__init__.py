"""The command line: stdout is data, stderr is talk, the exit code is the answer.

0 done or found; 1 ran well and the answer is no; 2 usage; 3 bad input or a library underneath failed. Keys and messages
never appear in logs or errors. Heavy libraries are imported by the commands, so that --help is quick.
"""

import json as json_text
import sys
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, NoReturn

import typer
import typer.main

from o3dmark._version import __version__
from o3dmark.cli._talk import say
from o3dmark.cli.campaigns import bench, report
from o3dmark.cli.catalogue import list_
from o3dmark.cli.copies import ledger
from o3dmark.cli.meshes import attack, compare, saliency, synth
from o3dmark.cli.owner import detect, embed, extract, keygen
from o3dmark.cli.tracing import issue, trace
from o3dmark.cli.viewing import view
from o3dmark.errors import BackendError, O3dmarkError
from o3dmark.threads import load_with_one_thread

__all__ = ["app", "commands", "main"]


def _version(wanted: bool) -> None:
    if wanted:
        print(__version__)
        raise typer.Exit


app = typer.Typer(
    name="o3dmark",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for _command in (
    *(keygen, embed, extract, detect, issue, trace),
    *(attack, compare, saliency, view, synth, list_, bench, report),
):
    app.command(_command.__name__.rstrip("_"))(_command)
app.add_typer(ledger)


@app.callback()
def about(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_version, help="Say it and leave.")
    ] = False,
) -> None:
    """Hide an ownership mark in 3-D meshes, and read it back after whatever the world did to them."""


_UsageError: Any = typer.BadParameter.__base__  # its own module differs between versions of typer


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and leave with its exit code."""
    load_with_one_thread()
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        code = app(words, standalone_mode=False) or 0
    except _UsageError as error:
        error.show()
        code = _fail("UsageError", error.format_message(), 2, "--json" in words, talk=False)
    except O3dmarkError as error:
        code = _fail(type(error).__name__, str(error), error.exit_code, "--json" in words)
    except (OSError, MemoryError) as error:
        code = _fail(
            BackendError.__name__, f"{type(error).__name__}: {error}", BackendError.exit_code, "--json" in words
        )
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    sys.exit(code)


def commands() -> dict[str, Any]:
    """Every command, those of groups too, by the words that call it."""
    return dict(_commands_of(typer.main.get_command(app)))


def _commands_of(group: Any, *words: str) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands_of(command, *words, name)
        else:
            yield " ".join((*words, name)), command


def _fail(name: str, text: str, code: int, json: bool, talk: bool = True) -> int:
    if json:
        print(json_text.dumps({"error": name, "message": text}))
    elif talk:
        say(text)
    return code
