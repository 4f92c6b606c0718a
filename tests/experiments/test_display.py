"""Which devices a study turns away, as shown in the builder and next to its links."""

import pytest

from experiments.declaration.tables import Display


@pytest.mark.parametrize(("width", "height"), [(0, 0), (390, 600), (800, 300)])
def test_a_study_that_a_phone_can_show_turns_none_away(width: int, height: int) -> None:
    assert Display(minimum_width_px=width, minimum_height_px=height).turned_away == ""


def test_a_window_larger_than_a_phone_is_said_with_its_size() -> None:
    assert Display().turned_away.startswith(
        "Phones cannot be used: the study needs a window of at least 800 x 500 px"
    )
    assert "tablets" in Display(allow_touch=False, minimum_width_px=0).turned_away
