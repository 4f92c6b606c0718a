"""The sync patch: a square that codes the number of the frame on the screen, filmed or seen by a photodiode.

`frontend/src/participant/playback/sync-patch.ts` draws it, in the same refresh as the frame.
"""
