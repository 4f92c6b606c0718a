"""Labelled blinks from the classifier's events: their frames, and neighbours that touch."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from stimuli_builder.blinks.bottom import turning_frame
from stimuli_builder.blinks.events.lid_event import LidEvent
from stimuli_builder.blinks.events.recognise import Recognised
from stimuli_builder.blinks.label_options import LabelOptions
from stimuli_builder.blinks.labelling import LabelledBlink, RefusedMinimum
from stimuli_builder.blinks.measure import smoothed
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import BlinkSeries

CUT = "its beginning or end lies in a gap or outside the recording"


def recognised_blinks(
    series: BlinkSeries, recognised: Recognised, options: LabelOptions
) -> tuple[list[LabelledBlink], list[RefusedMinimum]]:
    """Turn the blinks among the events of one eye into labelled blinks.

    Returns
    -------
    blinks, refused
        Blinks cut by a gap or by an end of the recording are refused.
    """
    smooth = smoothed(series, options)
    events = _parted([event for event in recognised.events if event.kind == "blink"], smooth, series.fps)
    blinks = [_labelled(event, touches, smooth, series.fps, options) for event, touches in events]
    refused = [RefusedMinimum(frame, CUT) for frame in recognised.cut]
    refused += [
        RefusedMinimum(event.frame, CUT)
        for (event, _), blink in zip(events, blinks, strict=True)
        if not blink
    ]
    return [blink for blink in blinks if blink], sorted(refused, key=lambda one: one.minimum)


def _parted(events: Sequence[LidEvent], smooth: Array, fps: float) -> list[tuple[LidEvent, bool]]:
    """Part blinks that touch at the widest opening between them."""
    parted = [(event, False) for event in events]
    for index, (first, second) in enumerate(pairwise(list(events))):
        if first.end_s < second.onset_s:
            continue
        between = smooth[first.frame : second.frame + 1]
        if between.size < 3 or not np.isfinite(between).any():
            continue
        widest = (first.frame + int(np.nanargmax(between))) / fps
        parted[index] = (replace(parted[index][0], end_s=widest), True)
        parted[index + 1] = (replace(second, onset_s=widest), True)
    return parted


def _labelled(
    event: LidEvent, touches: bool, smooth: Array, fps: float, options: LabelOptions
) -> LabelledBlink | None:
    onset = max(0, min(round(event.onset_s * fps), event.frame - 1))
    end = min(smooth.size - 1, max(round(event.end_s * fps), event.frame + 1))
    if not onset < event.frame < end or not np.isfinite(smooth[onset : end + 1]).all():
        return None
    lowest = onset + 1 + int(np.argmin(smooth[onset + 1 : end]))
    minimum = turning_frame(smooth, onset, lowest, end, options.minimum_tolerance)
    return LabelledBlink(
        onset, max(onset + 1, min(minimum, end - 1)), end, event.depth, float("nan"), touches, event
    )
