"""Who may try to sign in how often: known in the memory of one worker, and by no internet address in clear.

Nobody's wrong passwords keep another out: waiting times hold for a name *from one range of addresses*.
A browser that signed in before carries a device cookie and is counted by itself, whatever others do to
its name. Names that do not exist are counted as those that do.
"""

import hashlib
import hmac
import ipaddress
import secrets
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from server.errors import ApiError, TooManyRequests
from server.rate_limit import RateLimit
from server.settings import Settings
from server.tokens import derived_token, new_token

DEVICE_COOKIE = "palpebra_device"
PURPOSE = "device"
FREE_FAILURES = 5
LONGEST_WAIT_S = 900.0
FORGOTTEN_S = 6 * 3600.0
RECORDS_PER_MINUTE = 20
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


class TooManyFailures(TooManyRequests):
    """Wrong credentials came too often from here."""

    code = "too_many_failures"


class BackOff:
    """Waiting times by key that double with each failure after the first few."""

    def __init__(self, free: int = FREE_FAILURES, clock: Callable[[], float] = time.monotonic) -> None:
        self.free, self._clock = free, clock
        self._lock = threading.Lock()
        self._failures: dict[str, tuple[int, float]] = {}

    def check(self, key: str) -> None:
        """TooManyFailures where `key` has to wait still."""
        with self._lock:
            number, last = self._failures.get(key, (0, 0.0))
            over = number - self.free
            left = last + min(LONGEST_WAIT_S, 2.0 ** min(over, 20)) - self._clock() if over >= 0 else 0.0
        if left > 0:
            wait = max(1, round(left))
            raise TooManyFailures(
                f"Too many wrong attempts; please try again in {wait} s.", headers={"retry-after": str(wait)}
            )

    def failed(self, key: str) -> None:
        """Count one failure."""
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


class SignInThrottle:
    """The limits of everything that costs a password's hash."""

    def __init__(self, settings: Settings) -> None:
        self._salt = secrets.token_bytes(16)
        self.names = BackOff()
        self.codes = BackOff()
        self.per_range = RateLimit(settings.logins_per_minute)
        self.overall = RateLimit(settings.logins_per_minute_overall)
        self._records, self._unwritten = RateLimit(RECORDS_PER_MINUTE), 0
        self.per_device = RateLimit(settings.logins_per_minute)
        self.logouts = RateLimit(settings.logins_per_minute)

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

    @contextmanager
    def logout(self, provider: str, address: str) -> Iterator[None]:
        """Count refused logout tokens of a provider; TooManyRequests where too many came before."""
        key = self._hidden(f"logout {provider} from {address_range(address)}")
        self.logouts.check(key)
        try:
            yield
        except ApiError:
            self.logouts.hit(key)
            raise

    def written(self) -> int | None:
        """How many failed sign-ins were not written down since the last; None: do not write this one.

        A flood must not fill the audit log, and with it the disk.
        """
        try:
            self._records.hit(_EVERYBODY)
        except TooManyRequests:
            self._unwritten += 1
            return None
        unwritten, self._unwritten = self._unwritten, 0
        return unwritten

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
