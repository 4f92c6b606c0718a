"""The photorealistic character: geometry, textures and hair of our own, rendered by Cycles into an atlas.

Lengths are mm; x is right, y up, z towards the viewer, the eyes' centres at x = +-30. A *local* x is
|x| - 30, so it grows towards the temple on both sides.
"""
