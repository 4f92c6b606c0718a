"""The rows as a table for people: Markdown, as in docs/participant.md."""

from collections.abc import Sequence
from statistics import median, quantiles

from tools.scope.compare import Play
from tools.scope.measure import Row

HEADER = (
    "browser", "fps", "condition", "plays", "not measured", "good", "good, yet off or a frame not shown",
    "right", "right, called otherwise", "worst off (ms)", "key to first pixel, median (95%) (ms)",
    "record's bias (ms)", "polls a second", "poller blind, longest (ms), share", "load",
)  # fmt: skip


def cells(row: Row) -> list[str]:
    """One line of the table. Plays that the poller could not follow count in their own column alone."""
    plays = [play for play in row.plays if play.is_measured]
    good = [play for play in plays if play.record.verdict == "good"]
    right = [play for play in plays if play.is_right]
    otherwise = [play for play in right if play.record.verdict != "good"]
    off = [play for play in good if play.is_off]
    return [
        row.browser,
        str(row.fps),
        row.condition,
        str(len(row.plays) + row.lost),
        str(len(row.plays) - len(plays) + row.lost),
        str(len(good)),
        _share(len(off), len(good)),
        str(len(right)),
        _share(len(otherwise), len(right)),
        f"{max((play.worst_off_ms for play in good), default=0):.0f}",
        _median_and_95([play.key_to_pixel_ms for play in plays]),
        _median_and_95([_bias(play) for play in plays if play.record.key_to_first_frame_ms is not None]),
        f"{row.polls_per_s:.0f}" + ("" if row.real_time else " (ordinary priority)"),
        f"{row.blind_ms:.0f}, {100 * row.blind_share:.1f}%",
        " to ".join(dict.fromkeys(f"{load:.1f}" for load in (min(row.loads), max(row.loads)))),
    ]


def _share(part: int, whole: int) -> str:
    return f"{part} ({100 * part / whole:.0f}%)" if whole else "0"


def _bias(play: Play) -> float:
    return play.key_to_pixel_ms - (play.record.key_to_first_frame_ms or 0.0)


def _median_and_95(values: Sequence[float]) -> str:
    if len(values) < 2:
        return "".join(f"{value:.0f}" for value in values)
    return f"{median(values):.0f} ({quantiles(values, n=20, method='inclusive')[-1]:.0f})"


def markdown(lines: Sequence[Sequence[str]]) -> str:
    """Lines of cells under the header."""
    table = [HEADER, tuple("---" for _ in HEADER), *lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in table)
