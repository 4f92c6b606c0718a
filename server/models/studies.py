"""Studies, their versions, clips and links."""

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, Index, String, Text, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column, relationship

from server.core.values import new_pseudonym_key, now
from server.models.base import Base, one_of


class Study(Base):
    """A study on this server. What is declared lies in its versions; new runs use `active_version`.

    Attributes
    ----------
    status : str
        Draft (only previews), pilot, live, closed.
    paused : bool
        No new runs for the moment.
    quota : int or None
        Complete runs after which the study closes itself.
    revision : int
        Counts edits, so that of two people editing at once the second is told.
    recruiter : dict of str to Any or None
        See `server.participation.recruiter`.
    archived_at : datetime or None
        Since when it is out of the list of studies; it can be read, and not changed.
    pseudonym_key : str
        What the names of its participants are made with; it never leaves the database.
    workspace_id : int or None
        The laboratory it belongs to; a study of none is open to nobody but the command line.
    """

    __tablename__ = "studies"
    __table_args__ = (one_of("status", "draft", "pilot", "live", "closed"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(60), unique=True)
    title: Mapped[str] = mapped_column(String(300))
    status: Mapped[str] = mapped_column(String(10), default="draft")
    paused: Mapped[bool] = mapped_column(default=False)
    active_version: Mapped[int] = mapped_column(default=1)
    quota: Mapped[int | None]
    recruiter: Mapped[dict[str, Any] | None]
    revision: Mapped[int] = mapped_column(default=1)
    created_at: Mapped[datetime] = mapped_column(default=now)
    created_by: Mapped[int | None] = mapped_column(ForeignKey("accounts.id", ondelete="SET NULL"))
    opened_at: Mapped[datetime | None]
    closed_at: Mapped[datetime | None]
    archived_at: Mapped[datetime | None]
    pseudonym_key: Mapped[str] = mapped_column(String(64), default=new_pseudonym_key)
    workspace_id: Mapped[int | None] = mapped_column(ForeignKey("workspaces.id"), index=True)

    versions: Mapped[list["StudyVersion"]] = relationship(
        back_populates="study", order_by="StudyVersion.number", cascade="all, delete-orphan"
    )


class StudyVersion(Base):
    """One frozen declaration of a study with the manifest of its clips; never changed once a run uses it.

    Attributes
    ----------
    format : int
        Of the stored definition.
    series : int
        Versions of a study that measure the same have the same number; only their answers may be pooled.
    """

    __tablename__ = "study_versions"
    __table_args__ = (UniqueConstraint("study_id", "number"), {"sqlite_autoincrement": True})

    id: Mapped[int] = mapped_column(primary_key=True)
    study_id: Mapped[int] = mapped_column(ForeignKey("studies.id", ondelete="CASCADE"))
    number: Mapped[int]
    experiment: Mapped[str] = mapped_column(String(60))
    definition_toml: Mapped[str] = mapped_column(Text)
    definition: Mapped[dict[str, Any]]
    definition_sha256: Mapped[str] = mapped_column(String(64))
    manifest: Mapped[dict[str, Any]]
    inter_ocular_px: Mapped[float | None]
    note: Mapped[str] = mapped_column(Text, default="")
    format: Mapped[int] = mapped_column(default=1)
    series: Mapped[int] = mapped_column(default=1)
    created_at: Mapped[datetime] = mapped_column(default=now)
    created_by: Mapped[int | None] = mapped_column(ForeignKey("accounts.id", ondelete="SET NULL"))

    study: Mapped[Study] = relationship(back_populates="versions")
    clips: Mapped[list["VersionClip"]] = relationship(
        back_populates="version", order_by="VersionClip.id", cascade="all, delete-orphan"
    )


class Clip(Base):
    """The bytes of a clip in the clip store, by their SHA-256; studies share clips."""

    __tablename__ = "clips"

    sha256: Mapped[str] = mapped_column(String(64), primary_key=True)
    bytes: Mapped[int]
    fps: Mapped[float]
    frames: Mapped[int]
    width_px: Mapped[int]
    height_px: Mapped[int]
    created_at: Mapped[datetime] = mapped_column(default=now)


class VersionClip(Base):
    """A clip's place in a study version: its cell, levels and exemplar.

    The clips of motion checks have no cell (`CHECK_CELL`); their level is `check`, their exemplar its number.

    Attributes
    ----------
    blinks_s : list of float or None
        Onsets of the blinks of a performance in s; None for other clips.
    """

    __tablename__ = "version_clips"
    __table_args__ = (UniqueConstraint("version_id", "cell", "exemplar"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    version_id: Mapped[int] = mapped_column(ForeignKey("study_versions.id", ondelete="CASCADE"))
    clip_sha256: Mapped[str] = mapped_column(ForeignKey("clips.sha256"), index=True)
    cell: Mapped[str] = mapped_column(Text)
    levels: Mapped[dict[str, str]]
    exemplar: Mapped[int]
    profile_id: Mapped[str] = mapped_column(String(200), default="")
    file: Mapped[str] = mapped_column(String(200))
    width_mm: Mapped[float | None]
    blinks_s: Mapped[list[float] | None]

    version: Mapped[StudyVersion] = relationship(back_populates="clips")
    clip: Mapped[Clip] = relationship()


class Link(Base):
    """A way in. The token itself is derived from the secret key and `public_id`; only its hash is stored.

    Attributes
    ----------
    kind : str
        General (any number of people), personal (one person, resumes on any device), preview (nothing is
        counted or exported).
    label : str
        Who or what it is for.
    synthetic : bool
        Its runs are simulated, not people.
    group_name : str
        The group its participants come into, where links decide; else empty.
    """

    __tablename__ = "links"
    __table_args__ = (
        one_of("kind", "general", "personal", "preview"),
        Index("ix_links_study_id_kind", "study_id", "kind"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    public_id: Mapped[str] = mapped_column(String(32), unique=True)
    study_id: Mapped[int] = mapped_column(ForeignKey("studies.id", ondelete="CASCADE"))
    kind: Mapped[str] = mapped_column(String(10))
    token_hash: Mapped[str] = mapped_column(String(64), unique=True)
    label: Mapped[str] = mapped_column(String(200), default="")
    synthetic: Mapped[bool] = mapped_column(default=False)
    group_name: Mapped[str] = mapped_column(Text, default="")
    quota: Mapped[int | None]
    recruiter: Mapped[dict[str, Any] | None]
    expires_at: Mapped[datetime | None]
    revoked_at: Mapped[datetime | None]
    created_at: Mapped[datetime] = mapped_column(default=now)
    created_by: Mapped[int | None] = mapped_column(ForeignKey("accounts.id", ondelete="SET NULL"))

    study: Mapped[Study] = relationship()
