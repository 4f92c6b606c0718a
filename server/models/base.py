"""What every table shares: names of constraints, time stamps in UTC, lists of allowed words."""

from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import JSON, CheckConstraint, DateTime, Dialect, Index, MetaData, String
from sqlalchemy.dialects import sqlite
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column
from sqlalchemy.types import TypeDecorator, TypeEngine

CONVENTION = {
    "ix": "ix_%(table_name)s_%(column_0_N_name)s",
    "uq": "uq_%(table_name)s_%(column_0_N_name)s",
    "ck": "ck_%(table_name)s_%(constraint_name)s",
    "fk": "fk_%(table_name)s_%(column_0_N_name)s",
    "pk": "pk_%(table_name)s",
}


class _IsoText(sqlite.DATETIME):
    """A moment as SQLAlchemy writes it for SQLite, by Python's own C code: a rating has a dozen."""

    def bind_processor(self, _dialect: Dialect) -> Callable[[datetime | None], str | None]:
        """What makes the text of a moment."""

        def text(moment: datetime | None) -> str | None:
            return None if moment is None else moment.isoformat(" ", "microseconds")

        return text


class UtcDateTime(TypeDecorator[datetime]):
    """A moment in UTC: `timestamptz` in PostgreSQL, ISO text without a zone in SQLite."""

    impl = DateTime
    cache_ok = True

    def load_dialect_impl(self, dialect: Dialect) -> TypeEngine[Any]:
        """The column type of this database."""
        if dialect.name == "sqlite":
            return dialect.type_descriptor(_IsoText())  # type: ignore[no-untyped-call]
        return dialect.type_descriptor(DateTime(timezone=True))

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Refuse a time without a zone; store UTC."""
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError(f"expected a time with its zone, got {value.isoformat()}")
        moment = value if value.tzinfo is UTC else value.astimezone(UTC)
        return moment if dialect.name == "postgresql" else moment.replace(tzinfo=None)

    def process_result_value(self, value: datetime | None, _dialect: Dialect) -> datetime | None:
        """Give back UTC with its zone."""
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


class Base(DeclarativeBase):
    """Base of every table."""

    metadata = MetaData(naming_convention=CONVENTION)
    type_annotation_map = {  # noqa: RUF012 - the form SQLAlchemy asks for
        datetime: UtcDateTime(),
        dict[str, Any]: JSON(none_as_null=True),
        dict[str, str]: JSON(none_as_null=True),
        dict[str, int]: JSON(none_as_null=True),
        list[str]: JSON(none_as_null=True),
        list[float]: JSON(none_as_null=True),
        list[dict[str, Any]]: JSON(none_as_null=True),
        list[list[float]]: JSON(none_as_null=True),
    }


def one_of(column: str, *words: str) -> CheckConstraint:
    """A check that `column` holds one of `words`."""
    listed = ", ".join(f"'{word}'" for word in words)
    return CheckConstraint(f"{column} IN ({listed})", name=f"{column}_known")


# What the processes of a server on PostgreSQL count together: who may do something how often.


class SharedCount(Base):
    """A share that is used up and refilled, or a row of failures; it is not data and is in no backup or copy.

    Attributes
    ----------
    key : str
        Keyed hash of what is counted, such as a range of addresses; it cannot be read back.
    amount : float
        What is left of the share, or how many failures there were.
    before : float
        What was left, refilled, before the last event.
    at : datetime
        When it was changed last; it goes some hours later.
    """

    __tablename__ = "shared_counts"
    __table_args__ = (Index("ix_shared_counts_at", "at"),)

    key: Mapped[str] = mapped_column(String(32), primary_key=True)
    amount: Mapped[float]
    before: Mapped[float]
    at: Mapped[datetime]
