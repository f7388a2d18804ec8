"""The arguments that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

In = Annotated[Path, typer.Argument(metavar="IN", help="A mesh: PLY, OBJ, OFF, STL, GLB or glTF.")]
Out = Annotated[Path, typer.Argument(metavar="OUT", help="The file to write; its ending says the format.")]
Seed = Annotated[int, typer.Option("--seed", metavar="N", help="Makes the randomness repeatable.")]
Json = Annotated[bool, typer.Option("--json", help="One JSON object on stdout instead of a table.")]
