"""A zip that is opened without reading more at once than its list of files may have."""

import io

from experiments.errors import InputError

MAX_DIRECTORY_BYTES = 8 << 20
"""Of a zip's list of its files, which is read as a whole: an entry of 47 bytes takes hundreds."""


class ZipListError(InputError):
    """A zip names more files than anything that is taken here has."""


class BoundedZip(io.FileIO):
    """The file of a zip, for `ZipFile`, from which nothing larger than a directory may be is read at once.

    `ZipFile` reads the directory in one piece, however many files it names, before they can be counted; files
    are read in smaller ones.
    """

    def read(self, size: int | None = -1, /) -> bytes:
        """As of any file; ZipListError where more is asked for than the list may have."""
        if size is not None and size > MAX_DIRECTORY_BYTES:
            raise ZipListError(
                f"the zip's list of files has {size >> 20} MiB, at most {MAX_DIRECTORY_BYTES >> 20} are read"
            )
        return super().read(-1 if size is None else size)
