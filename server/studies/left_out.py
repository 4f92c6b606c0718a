"""Files of an upload that are left out of the study to be made: set aside, and put back when asked for."""

from pathlib import Path

from experiments.manifest import MANIFEST_NAME
from experiments.own_clips import check_names, one_form
from server.errors import Invalid, NotFound
from server.transcoding.records import records_of, videos_of, write_record
from video_conversion.prepared import Prepared, clip_name

ASIDE = ".left_out"
"""Folder in an upload's folder; what is in it is no file of the upload, and goes with it."""


def files_aside(folder: Path) -> list[Path]:
    """The files that an upload leaves out, by name."""
    aside = folder / ASIDE
    return videos_of(aside) if aside.is_dir() else []


def leave_out(folder: Path, name: str) -> None:
    """Set one file aside; one that is left out already stays so.

    What is known of it goes along: another file of its name is looked into as any other.

    Raises
    ------
    NotFound
        The upload has no such file.
    Invalid
        It is still being looked into, or belongs to a built set, which is taken as a whole.
    """
    file, aside = _named(videos_of(folder), name), folder / ASIDE
    if file is None:
        if _named(files_aside(folder), name) is None:
            raise NotFound(f"This upload has no file '{name[:100]}'.")
        return
    if (folder / MANIFEST_NAME).exists():
        raise Invalid(
            "The clips of a built set are taken as a whole; leave out what its definition leaves out."
        )
    record = records_of(folder).get(file.name)
    if record is None:
        raise Invalid(f"'{file.name}' is still being looked into; leave it out once it has been.")
    aside.mkdir(mode=0o700, exist_ok=True)
    write_record(aside, record)
    write_record(folder, Prepared(name=file.name, asked_fps=None, replaced=True))
    file.replace(aside / file.name)


def put_back(folder: Path, name: str) -> None:
    """Take a file in again that was left out; one that is there already stays.

    It is looked into again only where another frame rate was asked for, before or since.

    Raises
    ------
    NotFound
        The upload has no such file.
    Invalid
        Another file of its name, or one that would be the same clip, has come since.
    """
    file, there = _named(files_aside(folder), name), videos_of(folder)
    if file is None:
        if _named(there, name) is None:
            raise NotFound(f"This upload has no file '{name[:100]}'.")
        return
    target = folder / file.name
    if target.exists():
        raise Invalid(f"Another '{file.name}' has come since; leave that one out first.")
    check_names(clip_name(path.name) for path in (*there, file))
    record = records_of(file.parent).get(file.name)
    file.replace(target)
    if record is not None:
        write_record(folder, record)


def _named(files: list[Path], name: str) -> Path | None:
    # Looked up among the names that there are: nothing that is sent becomes a path.
    asked = one_form(name)
    return next((path for path in files if path.name == asked), None)
