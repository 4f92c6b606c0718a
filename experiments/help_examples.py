"""Examples in the help of a command, as lines that a shell takes as they are printed."""

import re

CONTINUED = " \\"
INDENT = "    "
_BEFORE_OPTION = re.compile(r" (?=--?[a-z])")
_BESIDE_ITS_WORD = re.compile(r"\n?^Example: (.+)(?=\n\n|\Z)", re.MULTILINE)


def whole_examples(text: str, width: int) -> str:
    """Break the examples of a help text at options, so that no line is wider than `width` where it can be.

    Parameters
    ----------
    text : str
        A help text; an example is an indented paragraph of one line, or what stands behind `Example: `.
    width : int
        Characters in a line.

    Returns
    -------
    str
        The text; before each example stands click's mark of a paragraph that is not wrapped.
    """
    # Behind its word, within a paragraph, click would wrap it as prose.
    paragraphs = _BESIDE_ITS_WORD.sub(r"\n\nExample:\n\n  \1", text.strip()).split("\n\n")
    return "\n\n".join(
        _whole(one, width) if one.startswith("  ") and "\n" not in one.strip() else one for one in paragraphs
    )


def _whole(example: str, width: int) -> str:
    indent = "  "
    command, mark, comment = example.strip().partition(" # ")
    lines = broken(command.strip(), width - len(indent))
    if mark:
        beside = f"{lines[-1]}  # {comment.strip()}"
        fits = len(indent + beside) <= width
        lines = [*lines[:-1], beside] if fits else [f"# {comment.strip()}", *lines]
    return "\b\n" + "\n".join(indent + line for line in lines)


def broken(command: str, width: int) -> list[str]:
    """A command as lines that end in a backslash but for the last, broken before options.

    Parameters
    ----------
    command : str
    width : int
        Characters in a line, the backslash included.

    Returns
    -------
    list of str

    Examples
    --------
    >>> broken("stimuli build exp1 --out clips --preview", 28)
    ['stimuli build exp1 \\\\', '    --out clips --preview']
    """
    if len(command) <= width:
        return [command]
    first, *options = _BEFORE_OPTION.split(command)
    lines = [first]
    for number, option in enumerate(options, start=1):
        longer = f"{lines[-1]} {option}"
        room = width if number == len(options) else width - len(CONTINUED)
        if len(longer) <= room:
            lines[-1] = longer
        else:
            lines.append(INDENT + option)
    return [*(line + CONTINUED for line in lines[:-1]), lines[-1]]
