"""The arguments that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

In = Annotated[
    Path,
    typer.Argument(
        metavar="IN", help="A mesh: PLY, OBJ, OFF, STL, GLB, glTF, 3MF, USD; to read a mark, also a point cloud."
    ),
]
Out = Annotated[Path, typer.Argument(metavar="OUT", help="The file to write; its ending says the format.")]
Seed = Annotated[int, typer.Option("--seed", metavar="N", help="Makes the randomness repeatable.")]
Json = Annotated[bool, typer.Option("--json", help="One JSON object on stdout instead of a table.")]
Verbose = Annotated[bool, typer.Option("--verbose", help="All that is known below the answer, not the main of it.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="OUT may be replaced; what was given never is.")]
AnyScale = Annotated[
    bool, typer.Option("--any-scale", help="Look for fragments whose unit of length was changed; a minute or two.")
]
Mirrored = Annotated[
    bool, typer.Option("--mirrored", help="Look for fragments that were mirrored or turned inside out.")
]
