"""What the uploads of one account may hold together; each is removed after a day."""

import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from server.studies.uploaded_file import UploadTooLarge
from server.transcoding.records import sender

MAX_UPLOADS = 200
"""Of an account within a day."""


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
            f"{self.bytes / 1e9:.1f} GB in {MAX_UPLOADS} are kept. "
            "Each is removed after a day; studies that were made of them stay."
        )


def _sizes(upload: Path) -> Iterator[int]:
    # Files and folders may go at any moment: the worker's own, and those that become a study.
    try:
        with os.scandir(upload) as entries:
            for entry in entries:
                yield from _sizes(Path(entry.path)) if entry.is_dir(follow_symlinks=False) else _size(entry)
    except (FileNotFoundError, NotADirectoryError):
        return


def _size(entry: os.DirEntry[str]) -> Iterator[int]:
    with suppress(FileNotFoundError):
        yield entry.stat(follow_symlinks=False).st_size
