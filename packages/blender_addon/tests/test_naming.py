"""Names of rigs: known schemes, sides in any spelling, and nothing made up."""

import pytest
from blender_addon.naming import guesses

ARKIT = ["jawOpen", "eyeBlinkLeft", "eyeBlinkRight", "eyeLookDownLeft", "eyeSquintLeft", "eyeWideRight"]
VROID = ["Fcl_ALL_Angry", "Fcl_EYE_Close", "Fcl_EYE_Close_R", "Fcl_EYE_Close_L", "Fcl_EYE_Joy_L"]


@pytest.mark.parametrize(
    ("names", "title", "pair"),
    [
        (ARKIT, "ARKit", ("eyeBlinkLeft", "eyeBlinkRight")),
        (VROID, "VRM (VRoid)", ("Fcl_EYE_Close_L", "Fcl_EYE_Close_R")),
        (["head_lod0_mesh__eye_blink_L", "head_lod0_mesh__eye_blink_R"], "MetaHuman", None),
        (["Eye_Blink_L", "Eye_Blink_R", "Eye_Wide_L"], None, ("Eye_Blink_L", "Eye_Blink_R")),
        (["smile", "EyesClosed.L", "EyesClosed.R"], "by name", ("EyesClosed.L", "EyesClosed.R")),
        (["wink_right", "wink_left"], "by name", ("wink_left", "wink_right")),
        (["LeftEyeShut", "RightEyeShut"], "by name", ("LeftEyeShut", "RightEyeShut")),
        (["smile", "blink"], "both eyes by one shape", ("blink", "blink")),
    ],
)
def test_shape_keys(names: list[str], title: str | None, pair: tuple[str, str] | None) -> None:
    first = guesses(names, [])[0]
    assert title in (None, first.title)
    assert (first.left, first.right) == (pair or tuple(names))


def test_bones_of_the_upper_lid_only() -> None:
    bones = ["lid.T.L.002", "lid.T.R.002", "lid.B.L.002", "lid.B.R.002", "spine"]
    table = guesses([], bones)
    assert (table[0].left, table[0].right) == ("lid.T.L.002", "lid.T.R.002")
    assert not any("lid.B" in guess.left for guess in table)


def test_a_rig_without_lids_has_no_guess() -> None:
    assert guesses(["smile", "jawOpen", "browUp_L"], ["spine", "hand.L"]) == []


def test_no_pair_stands_twice() -> None:
    pairs = [(guess.left, guess.right) for guess in guesses(ARKIT + VROID, [])]
    assert len(pairs) == len(set(pairs))
