import numpy as np
import pytest

from stimuli_builder.clips.preview import thumbnail


@pytest.mark.parametrize(
    ("size", "shown"), [((960, 360), (200, 75)), ((720, 900), (128, 160)), ((64, 24), (200, 75))]
)
def test_a_frame_keeps_its_proportions_on_the_sheet(size: tuple[int, int], shown: tuple[int, int]) -> None:
    assert thumbnail(np.zeros((size[1], size[0], 3), np.uint8)).size == shown
