"""Who may try to sign in how often: by no internet address in clear; on PostgreSQL in all processes together.

Nobody's wrong passwords keep another out: waiting times hold for a name *from one range of addresses*.
A browser that signed in before carries a device cookie and is counted separately, whatever others do to
its name. Names that do not exist are counted as those that do.
"""

import hashlib
import hmac
import ipaddress
import secrets
import threading
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

from fastapi.concurrency import run_in_threadpool

from server.core.errors import ApiError, TooManyRequests
from server.core.limits import BoundedRecords, RateLimit, SharedCounts
from server.core.settings import Settings
from server.core.values import derived_token, new_token

DEVICE_COOKIE = "palpebra_device"
PURPOSE = "device"
FREE_FAILURES = 5
LONGEST_WAIT_S = 900.0
FORGOTTEN_S = 6 * 3600.0
RECORDS_PER_MINUTE = 20
LETTERS_FROM_A_RANGE = 3
"""Letters to one account for a new password that a range of addresses may ask for within `FORGOTTEN_S`."""
_MAX_KEYS = 20_000
_EVERYBODY, _EVERYBODY_BACK = "everybody", "everybody who comes back"


def address_range(address: str) -> str:
    """The /24 of an IPv4 and the /64 of an IPv6 address; the text itself where it is none."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return address
    if isinstance(parsed, ipaddress.IPv6Address) and parsed.ipv4_mapped is not None:
        parsed = parsed.ipv4_mapped
    bits = 24 if parsed.version == 4 else 64
    return str(ipaddress.ip_network((parsed, bits), strict=False))


class TooManyFailures(TooManyRequests, code="too_many_failures"):
    """Wrong credentials came too often from here."""


class BackOff:
    """Waiting times by key that double with each failure after the first few."""

    def __init__(
        self,
        free: int = FREE_FAILURES,
        clock: Callable[[], float] = time.monotonic,
        name: str = "",
        shared: SharedCounts | None = None,
    ) -> None:
        self.free, self._clock = free, clock
        self._name, self._shared = name, shared
        self._lock = threading.Lock()
        self._failures: dict[str, tuple[int, float]] = {}

    def check(self, key: str) -> None:
        """TooManyFailures where `key` has to wait still."""
        with self._lock:
            number, last = self._failures.get(key, (0, 0.0))
        left = self._left(number, self._clock() - last)
        if left <= 0 and self._shared is not None:
            left = self._left(*self._shared.failures(f"{self._name}:{key}"))
        if left > 0:
            wait = max(1, round(left))
            raise TooManyFailures(
                f"Too many failed attempts. Please try again in {wait} s.", headers={"retry-after": str(wait)}
            )

    def _left(self, number: int, ago_s: float) -> float:
        """Seconds to wait after `number` failures, the last `ago_s` ago; no wait if 0 or less."""
        over = number - self.free
        return min(LONGEST_WAIT_S, 2.0 ** min(over, 20)) - ago_s if over >= 0 else 0.0

    def failed(self, key: str) -> None:
        """Count one failure."""
        if self._shared is not None:
            self._shared.failed(f"{self._name}:{key}")
        with self._lock:
            number, last = self._failures.pop(key, (0, self._clock()))
            number = 0 if self._clock() - last > FORGOTTEN_S else number
            self._failures[key] = (number + 1, self._clock())
            if len(self._failures) > _MAX_KEYS:
                del self._failures[next(iter(self._failures))]

    def succeeded(self, key: str) -> None:
        """Forget the failures of `key`."""
        with self._lock:
            self._failures.pop(key, None)
        if self._shared is not None:
            self._shared.forget(f"{self._name}:{key}")


# Decision 0300: Wrong passwords make an address wait, not an account.
class SignInThrottle:
    """The limits of everything that costs a password's hash."""

    def __init__(self, settings: Settings, shared: SharedCounts | None = None) -> None:
        # Shared counts are known by a key of the installation's instead, the same in every process.
        self._salt = secrets.token_bytes(16) if shared is None else b""
        self.names = BackOff(name="names", shared=shared)
        self.codes = BackOff(name="codes", shared=shared)

        def limit(name: str, per_minute: int) -> RateLimit:
            return RateLimit(per_minute, name=name, shared=shared)

        self.per_range = limit("range", settings.logins_per_minute)
        self.overall = limit("overall", settings.logins_per_minute_overall)
        self._letters = RateLimit(LETTERS_FROM_A_RANGE, name="letters", shared=shared, window_s=FORGOTTEN_S)
        self._records = BoundedRecords(RECORDS_PER_MINUTE, RECORDS_PER_MINUTE)
        self.per_device = limit("device", settings.logins_per_minute)
        self.logouts = limit("logouts", settings.logins_per_minute)

    def key(self, name: str, address: str, device: str | None) -> str:
        """What failures are counted by: the name, and the device or the range of addresses; unreadable."""
        origin = f"device {device}" if device else f"range {address_range(address)}"
        return self._hidden(f"{name.casefold()}\n{origin}")

    def enter(self, key: str, address: str, device: str | None) -> None:
        """Count an attempt; TooManyRequests where there were too many."""
        self.names.check(key)
        if device:
            self.per_device.hit(self._hidden(device))
            return
        self.per_range.hit(self._hidden(address_range(address)))
        self.overall.hit(_EVERYBODY)

    def come_back(self, address: str) -> None:
        """Count a browser that a provider sent back; TooManyRequests where there were too many.

        Apart from the attempts: its own was counted when it began, and to follow a link takes nobody's away.
        """
        self.per_range.hit(self._hidden(f"back at {address_range(address)}"))
        self.overall.hit(_EVERYBODY_BACK)

    @asynccontextmanager
    async def logout(self, provider: str, address: str) -> AsyncIterator[None]:
        """Count refused logout tokens of a provider; TooManyRequests where too many came before."""
        key = self._hidden(f"logout {provider} from {address_range(address)}")
        await run_in_threadpool(self.logouts.check, key)
        try:
            yield
        except ApiError:
            await run_in_threadpool(self.logouts.hit, key)
            raise

    def may_have_letter(self, account_id: int, address: str) -> bool:
        """Count a letter to an account that is asked for from an address; False where that is too often."""
        try:
            self._letters.hit(self._hidden(f"letter to {account_id} from {address_range(address)}"))
        except TooManyRequests:
            return False
        return True

    def written(self) -> int | None:
        """How many failed sign-ins were not written down since the last; None: do not write this one."""
        return self._records.written()

    def _hidden(self, text: str) -> str:
        return hashlib.blake2b(text.encode("utf-8", "replace"), key=self._salt, digest_size=16).hexdigest()


def new_device(key: bytes, name: str) -> str:
    """The device cookie of a browser that has just signed in as `name`."""
    nonce = new_token()
    return f"{nonce}.{derived_token(key, PURPOSE, f'{nonce}:{name.casefold()}')}"


def known_device(key: bytes, name: str, cookie: str | None) -> str | None:
    """The device's own name where its cookie was given to it for `name`; else None."""
    nonce, _, proof = (cookie or "").partition(".")
    expected = derived_token(key, PURPOSE, f"{nonce}:{name.casefold()}")
    return nonce if proof and hmac.compare_digest(proof.encode(), expected.encode()) else None
