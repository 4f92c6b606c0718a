"""What every table, figure and sentence of made data is called."""

SYNTHETIC_MARK = " [SYNTHETIC DATA]"


def marked(name: str, synthetic: bool) -> str:
    """The name of data, with the mark where no person gave them."""
    return f"{name}{SYNTHETIC_MARK if synthetic else ''}"


def caption(what: str, name: str, synthetic: bool) -> str:
    """Title of a table: what it shows, of which data, and that they are synthetic where they are."""
    return marked(f"{what}, {name}", synthetic)


def in_words(name: str) -> str:
    """The name of a scale as the head of a part has it."""
    return name[:1].upper() + name[1:].replace("_", " ")
