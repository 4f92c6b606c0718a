"""The pages of a study in one language."""

from experiments.base import Declaration


class Texts(Declaration):
    """The pages of one language, in Markdown. `screened_out` stands in for a few words of the page's own."""

    consent: str
    """First page. Nothing is stored of the participant before they agree to it."""
    instructions: str
    """Page before practice: what is seen, what is asked, which keys answer."""
    debrief: str
    """Last page: what the study is about. Shown after the last answer only."""
    practice: str = ""
    """Page before the practice trials; empty shows how many there are, and that they do not count."""
    block_break: str = ""
    """Page between blocks; empty shows a few words of the page's own."""
    screened_out: str = ""
    """Page of a participant whom a [[screening]] rule ends; empty shows a few words of the page's own."""
