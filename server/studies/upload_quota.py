"""What the uploads of one account may hold together, until they become studies or a day is over."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from server.studies.uploaded_file import UploadTooLarge

MAX_UPLOADS = 200
"""Of an account within a day."""
_WHOSE = ".account"
"""File of an upload's folder with the number of the account that sent it."""


@dataclass(frozen=True)
class Quota:
    """The room of one account.

    It is looked at before bytes come and again once they are on the disk, before they get their name: of
    several that come at once, by whatever worker, the last to look sees the others.

    Attributes
    ----------
    folder : Path
        Of every account's uploads.
    account : int
        Its number.
    bytes : int
        That its uploads may hold together.
    """

    folder: Path
    account: int
    bytes: int

    def check(self, further: int = 0) -> None:
        """UploadTooLarge where the account holds more than it may, or `further` uploads were too many."""
        self._room(further)

    def room(self) -> int:
        """Bytes that may come still; UploadTooLarge where there are none."""
        left = self._room(0)
        if not left:
            raise self._full(self._held())
        return left

    def full(self) -> UploadTooLarge:
        """What is said where more comes than there is room for."""
        return self._full(self._held())

    def _room(self, further: int) -> int:
        held = self._held()
        if held > self.bytes or (further and len(self._own()) + further > MAX_UPLOADS):
            raise self._full(held)
        return self.bytes - held

    def _own(self) -> list[Path]:
        folders = self.folder.iterdir() if self.folder.is_dir() else ()
        return [one for one in folders if sender(one) == str(self.account)]

    def _held(self) -> int:
        # What is made beside the files, and what is set aside, takes room too.
        return sum(size for one in self._own() for size in _sizes(one))

    def _full(self, held: int) -> UploadTooLarge:
        return UploadTooLarge(
            f"Your uploads of the last day hold {held / 1e9:.1f} GB in {len(self._own())} folders; at most "
            f"{self.bytes / 1e9:.1f} GB in {MAX_UPLOADS} are kept. Make studies of them, or wait a day."
        )


def mark(upload: Path, account: int) -> None:
    """Say whose an upload is."""
    (upload / _WHOSE).write_text(str(account), encoding="ascii")


def sender(upload: Path) -> str | None:
    """The number of the account that sent an upload; None where nobody is named."""
    # Uploads that an older release took have no sender; they end within a day.
    try:
        return (upload / _WHOSE).read_text(encoding="ascii")
    except (FileNotFoundError, NotADirectoryError):
        return None


def _sizes(upload: Path) -> Iterator[int]:
    # Files and folders may go at any moment: the worker's own, and those that become a study.
    for folder, _, names in os.walk(upload):
        for name in names:
            try:
                yield Path(folder, name).lstat().st_size
            except FileNotFoundError:
                continue
