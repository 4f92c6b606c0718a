"""Every server test runs on SQLite and PostgreSQL; see tests/helpers."""

from tests.helpers.admins import experimenter, owner, viewer  # noqa: F401 - fixtures
from tests.helpers.databases import (  # noqa: F401 - fixtures
    database_url,
    empty_database_url,
    postgres_database,
    postgres_server,
    quick_folder,
    services,
    settings,
    sqlite_template,
)
from tests.helpers.passwords import quick_hashes  # noqa: F401 - fixture
from tests.helpers.seeds import one_seed, seeds_by_name  # noqa: F401 - fixtures
from tests.helpers.studies import client, participant, study  # noqa: F401 - fixtures
