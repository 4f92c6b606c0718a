"""Opinion scores as tables and words."""

from analysis.opinion.scores import OpinionResult
from analysis.report.captions import caption, marked
from analysis.report.formats import Table
from analysis.report.numbers import DASH, fixed, interval, share


def scores_table(result: OpinionResult, name: str, synthetic: bool = False) -> Table:
    """Items from the best down, within each group of items that people rated across."""
    rows = tuple(
        (
            item.name,
            *((str(item.group or DASH),) if result.n_groups > 1 else ()),
            fixed(item.mos),
            fixed(item.sd),
            str(item.n),
            interval((item.ci_low, item.ci_high)) if item.n > 1 else DASH,
            fixed(item.recovered),
            fixed(item.recovered_se),
        )
        for item in sorted(result.items, key=lambda one: (one.group or 0, -one.mos, one.name))
    )
    group = ("Group",) if result.n_groups > 1 else ()
    header = ("Item", *group, "MOS", "SD", "n", "95% CI", "Recovered", "SE")
    notes = ("Recovered: biases taken off, votes weighted by consistency (alternating projection).",)
    title = caption("Mean opinion scores", name, synthetic)
    return Table("opinion", title, header, rows, 1, notes)


def raters_table(result: OpinionResult, name: str, synthetic: bool = False) -> Table:
    """People from the most biased down."""
    rows = tuple(
        (
            person.name,
            str(person.n),
            DASH if person.bias is None else fixed(person.bias),
            DASH if person.inconsistency is None else fixed(person.inconsistency),
            DASH if person.correlation is None else share(person.correlation, 2),
            "rejected" if person.rejected_bt500 else "",
        )
        for person in sorted(result.participants, key=lambda one: (-abs(one.bias or 0.0), one.name))
    )
    header = ("Person", "Votes", "Bias", "Inconsistency", "r with MOS", "BT.500")
    title = caption("People", name, synthetic)
    return Table("opinion-people", title, header, rows, 1, (), True)


def opinion_text(result: OpinionResult, name: str, synthetic: bool = False) -> str:
    """What was computed, in words; nobody is left out by the screening."""
    rejected = [person.name for person in result.participants if person.rejected_bt500]
    said = [
        f"{marked(name, synthetic)}: {result.n_votes} votes on {len(result.items)} items "
        f"by {len(result.participants)} people; intervals from t with n - 1 degrees of freedom."
    ]
    if rejected:
        said.append(f"BT.500 would reject {', '.join(rejected)}; nobody was left out.")
    return " ".join([*said, *(f"{decision}." for decision in result.decisions)])
