"""A character on the geometry of ICT-FaceKit: identity, blink, skin, hair, eyes and bake. Lengths in cm.

The kit's axes: +x is the person's left, +y up, +z out of the face.
"""
