"""How a surface may move so that nobody sees it: where it bends, and which motions bend it least.

vertices, triangles -> hinges -> Motions: directions of each vertex, and a price of every motion
"""
