"""Marks in files: every mesh of an asset is marked in its own frame, and any of them may speak for the file.

embedding   asset, watermark, message, key -> the bytes of the marked asset, read back before they are returned
reading     asset or shape, watermark, key -> what was read, and in which part
views       the meshes that a received file shows, in the order in which they are looked at
choice      with which profile, where nobody says
layers      which layers of the mark are there
patches     which patches of the surface are
strength    how strong the mark came out, and what held it back
advice      what does work where a mark does not fit: tried, not guessed
"""

from o3dmark.marking.advice import advice
from o3dmark.marking.choice import Chosen, embed_by_any
from o3dmark.marking.embedding import Edition, Left, Marked, embed, mesh_of
from o3dmark.marking.layers import LayerRead, layers_read
from o3dmark.marking.patches import PatchesFound, patches_found
from o3dmark.marking.reading import PartDetection, PartReading, detect, extract
from o3dmark.marking.strength import Strength, strength
from o3dmark.marking.views import View, views

__all__ = [
    "Chosen",
    "Edition",
    "LayerRead",
    "Left",
    "Marked",
    "PartDetection",
    "PartReading",
    "PatchesFound",
    "Strength",
    "View",
    "advice",
    "detect",
    "embed",
    "embed_by_any",
    "extract",
    "layers_read",
    "mesh_of",
    "patches_found",
    "strength",
    "views",
]
