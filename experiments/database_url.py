"""The address of a database as its owner writes it, and as SQLAlchemy needs it."""

DRIVER = "postgresql+psycopg://"


def with_driver(url: str) -> str:
    """The address with the driver that this project uses, where it names PostgreSQL and no driver.

    Examples
    --------
    >>> with_driver("postgres://host/name")
    'postgresql+psycopg://host/name'
    """
    for prefix in ("postgres://", "postgresql://"):
        if url.startswith(prefix):
            return DRIVER + url.removeprefix(prefix)
    return url
