import pytest

from server.core.errors import TooManyRequests
from server.core.limits import RateLimit


def test_a_share_is_used_up_and_comes_back_with_time() -> None:
    moment = [0.0]
    limit = RateLimit(3, clock=lambda: moment[0])
    for _ in range(3):
        limit.hit("a")
    with pytest.raises(TooManyRequests):
        limit.hit("a")
    limit.hit("b")
    moment[0] = 20.0
    limit.hit("a")
    with pytest.raises(TooManyRequests) as refused:
        limit.hit("a")
    assert refused.value.headers == {"retry-after": "20"}
