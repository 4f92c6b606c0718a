from tests.helpers.admins import Admin


def test_the_shipped_blinks_are_served(viewer: Admin) -> None:
    library = viewer.get("/blinks/library").json()
    assert library["fps"] == 300
    assert len(library["profiles"]) >= 18
    for profile in library["profiles"]:
        assert max(profile["closure"]) <= 1.0
        assert profile["down_frames"] + profile["up_frames"] == len(profile["closure"]) - 1
    assert library["model"]["explained"]
