"""Pictures for people: drawn without a display, comparison sheets, pages for a browser, and an interactive window.

    render              mesh or point cloud, scalars     -> picture (h, w, 3) uint8
    render_scalars      the same, with its colour bar
    comparison_sheet    cover, marked, attacked          -> original, saliency, marked, displacement, attacked
    distance_sheet      marked, attacked, distances
    patches_panel       mesh, patches found in it        -> a panel, from the side that shows most of them
    sheet               panels of one's own choice
    best_side           mesh, scalars                    -> the camera that sees most of it, or of them
    Displacement        cover, marked                    -> how far each vertex was moved, and the mesh moved farther
    coloured            mesh or point cloud, scalars     -> a copy with vertex colours
    save_png, jpeg      a picture as a file, or as the bytes of one
    write_page          meshes to be turned in a browser, in one file
    show                a window, where there is a screen

Pictures are arrays; nothing is written or printed unless asked for.
"""

from o3dmark.view.camera import Camera
from o3dmark.view.colours import SALIENCY, coloured
from o3dmark.view.comparison import comparison_sheet, distance_sheet
from o3dmark.view.displacement import DISPLACEMENT, Displacement, agree, distance_from
from o3dmark.view.page import Shown, write_page
from o3dmark.view.patches import patches_panel
from o3dmark.view.render import Image, jpeg, render, save_png
from o3dmark.view.sheet import Panel, render_scalars, sheet
from o3dmark.view.side import best_side
from o3dmark.view.window import show

__all__ = [
    "DISPLACEMENT",
    "SALIENCY",
    "Camera",
    "Displacement",
    "Image",
    "Panel",
    "Shown",
    "agree",
    "best_side",
    "coloured",
    "comparison_sheet",
    "distance_from",
    "distance_sheet",
    "jpeg",
    "patches_panel",
    "render",
    "render_scalars",
    "save_png",
    "sheet",
    "show",
    "write_page",
]
