"""The bench of what reaches the screen: `make scope`.

A virtual display's frame buffer takes the place of a photodiode. A real-time poller reads bar-coded clips
from it while real browsers, headed, show them by real key presses, and each play is compared with its record.
The figures hold up to the frame buffer; only a photodiode or a fast camera shows what a monitor adds.
"""
