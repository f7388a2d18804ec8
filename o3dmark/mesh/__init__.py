"""The surface of a mesh, and what is computed on it.

surface         Open3D's mesh          -> Surface: welded, read-only arrays; and back
geometry        arrays                 -> areas, normals, edges, volumes, welding
proximity       points, a surface      -> the closest point of it
curvature       a surface              -> curvature per vertex
saliency        a mesh or a cloud      -> mesh saliency per vertex
smoothing       a surface              -> umbrella, Taubin and HC smoothing, undone
pn_triangles    a coarse surface       -> the curved one that it stands for
reconstruction  a point cloud          -> the closed surface through it
registration    two meshes             -> which vertex is which
fragments       a fragment, a whole    -> where on the whole it belongs
"""
