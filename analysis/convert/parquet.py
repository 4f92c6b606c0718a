"""A typed table as Parquet: levels as categories, the meaning of each column in the file's own metadata."""

from pathlib import Path

import pandas as pd

from analysis.convert.typed import Columns


def write_parquet(frame: pd.DataFrame, columns: Columns, target: Path) -> None:
    """Write a .parquet file; its metadata has a key a column, with its description."""
    from fastparquet import write

    described = {column.name: column.description for column in columns}
    write(str(target), frame, compression="GZIP", custom_metadata=described)
