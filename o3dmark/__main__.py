"""`python -m o3dmark` is `o3dmark`."""

from o3dmark.cli import main

main()
