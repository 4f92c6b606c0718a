"""The accuracy report by fold, as lines of text."""

from collections.abc import Iterator, Sequence

import numpy as np

from stimuli_builder.tracking.accuracy import HeldOut


def fold_lines(results: Sequence[HeldOut]) -> Iterator[str]:
    """One line a fold and one for all: RMS against labels, inter-eyelid distance, frames not found."""
    yield "accuracy on frames left out of training, in pixels of the video, against the labels as given"
    names = ("fold", "frames", "RMS", "median", "worst", "distance bias", "sd")
    widths = (6, 7, 8, 8, 8, 14, 7)
    yield " ".join(f"{name:>{width}}" for name, width in zip(names, widths, strict=True)) + "  not found"
    for fold in sorted({result.fold for result in results}):
        yield _line(str(fold + 1), [result for result in results if result.fold == fold])
    yield _line("all", results)


def _line(name: str, results: Sequence[HeldOut]) -> str:
    rms_px = [r.rms_px for r in results if r.rms_px is not None]
    errors = [r.distance_errors_px for r in results if r.distance_errors_px is not None]
    missing = len(results) - len(rms_px)
    if not rms_px:
        return f"{name:>6} {len(results):>7} {'none of them found':>40}  {missing}"
    rms, gaps = np.array(rms_px), np.concatenate(errors)
    total = float(np.sqrt((rms**2).mean()))
    return (
        f"{name:>6} {len(results):>7} {total:>8.2f} {np.median(rms):>8.2f} {rms.max():>8.2f} "
        f"{gaps.mean():>+14.2f} {gaps.std():>7.2f}  {missing}"
    )
