"""`analysis pairs` and `analysis thresholds`."""

from dataclasses import asdict, replace
from enum import StrEnum
from functools import partial
from hashlib import sha256
from math import isfinite, nan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from analysis.commands.output import (
    JsonOption,
    LevelsOption,
    equivalence_bounds,
    progress_spinner,
    save_json,
    show_figure,
    show_tables,
    show_text,
)
from experiments.errors import InputError

if TYPE_CHECKING:
    from analysis.pairs.abilities import PairsResult
    from analysis.pairs.comparisons import Comparisons
    from analysis.pairs.intervals import QuestionPair
    from analysis.pairs.jod_and_elo import Prior
    from analysis.report.contents import Picture
    from analysis.thresholds.answers import Answers
    from analysis.thresholds.people import ThresholdsResult


# `analysis pairs`.


class MethodChoice(StrEnum):
    """Model of the comparisons."""

    BRADLEY_TERRY = "bradley-terry"
    DAVIDSON = "davidson"
    RAO_KUPPER = "rao-kupper"
    THURSTONE = "thurstone"
    JOD = "jod"
    ELO = "elo"


SAMPLES_MIN = 100
"""Fewer samples do not hold 2.5% tails."""


class IntervalsChoice(StrEnum):
    """How 95% intervals of abilities are found."""

    WALD = "wald"
    PROFILE = "profile"
    BOOTSTRAP = "bootstrap"
    ANYTIME = "anytime"


class PriorChoice(StrEnum):
    """Prior of scores in JOD."""

    GAUSSIAN = "gaussian"
    NONE = "none"


def register(app: typer.Typer) -> None:
    """Add the commands to `app`."""
    app.command(name="pairs")(pairs)
    app.command(name="thresholds")(thresholds)


def pairs(
    file: Annotated[
        Path, typer.Argument(help="CSV file, one row per comparison, such as the server's export.")
    ],
    left: Annotated[str, typer.Option(help="Column of the item on the left (or shown first).")] = "left",
    right: Annotated[str, typer.Option(help="Column of the item on the right (or shown second).")] = "right",
    winner: Annotated[
        str, typer.Option(help="Column of the winner: left, right, or the item's name.")
    ] = "winner",
    tie: Annotated[str | None, typer.Option(help="The value for a tie in the winner's column.")] = None,
    participant: Annotated[
        str | None, typer.Option(help="Column that names the rater, for robust standard errors.")
    ] = None,
    method: Annotated[
        MethodChoice | None,
        typer.Option(
            help=(
                "bradley-terry, davidson or rao-kupper (ties), thurstone (case V), elo, or jod: case V in "
                "just-objectionable differences (1 JOD: 75% prefer the better), as pwcmp scales. Default: "
                "depends on whether there are ties."
            )
        ),
    ] = None,
    factors: Annotated[
        Path | None,
        typer.Option(
            help=(
                "CSV of the items: the first column is the item, the others are factors; abilities are "
                "linear in them."
            )
        ),
    ] = None,
    order_effect: Annotated[
        bool, typer.Option("--order-effect", help="Include an advantage of the left (first) side.")
    ] = False,
    firth: Annotated[
        bool, typer.Option("--firth", help="Finite estimates even if an item always wins (penalized).")
    ] = False,
    by: Annotated[
        str | None,
        typer.Option(help="Column of the content (scene): each is scaled separately, and all together."),
    ] = None,
    question: Annotated[
        str | None,
        typer.Option(help="Column of the question: each is fitted separately, then they are compared."),
    ] = None,
    intervals: Annotated[
        IntervalsChoice,
        typer.Option(
            help=(
                "Limits of abilities and differences: wald, profile (likelihood), bootstrap (of raters), or "
                "anytime: valid while you watch answers arrive."
            )
        ),
    ] = IntervalsChoice.WALD,
    equivalence: Annotated[
        str | None,
        typer.Option(help="Bounds of equivalence of two abilities, on the method's scale: 0.3 or -0.2,0.4."),
    ] = None,
    crossed: Annotated[
        bool,
        typer.Option(
            "--crossed",
            help=(
                "Random effects of raters on items; with --by also of contents, with --factors of items "
                "beyond their factors."
            ),
        ),
    ] = False,
    k_factor: Annotated[
        float, typer.Option(help="For elo: points that one comparison can move at most.")
    ] = 32.0,
    prior: Annotated[
        PriorChoice, typer.Option(help="For jod: pwcmp's prior, or none (maximum likelihood).")
    ] = PriorChoice.GAUSSIAN,
    reference: Annotated[
        str | None,
        typer.Option(help="For jod: item whose score is fixed, ITEM or ITEM=10. Default: a mean of 0."),
    ] = None,
    bootstrap: Annotated[
        int,
        typer.Option(
            help="Samples for jod, elo and --intervals bootstrap: 100 or more, or 0 for no intervals.", min=0
        ),
    ] = 500,
    screen: Annotated[
        bool,
        typer.Option("--screen", help="For jod: find raters whose answers are unlike the others'."),
    ] = False,
    levels: LevelsOption = None,
    json: JsonOption = None,
) -> None:
    """Abilities of items from paired comparisons.

    Examples:

      analysis pairs comparisons.csv --json abilities.json

      analysis pairs table.csv --left a --right b --winner choice --tie same --participant id

      analysis pairs table.csv --method thurstone --factors items.csv

      analysis pairs comparisons.csv --levels left=baseline,ours,recorded

      analysis pairs comparisons.csv --by scene --participant observer --method jod --screen

      analysis pairs table.csv --method rao-kupper --tie same --intervals profile

      analysis pairs table.csv --participant id --intervals anytime

      analysis pairs table.csv --participant id --by scene --crossed
    """
    from analysis.pairs.abilities import read_item_factors
    from analysis.pairs.comparisons import read_comparisons

    if 0 < bootstrap < SAMPLES_MIN:
        raise InputError(f"--bootstrap takes 0 or at least {SAMPLES_MIN} samples, got {bootstrap}")
    with progress_spinner("reading comparisons"):
        # The items are levels of `left`; any other ordered column is a factor of the items.
        orders = levels or []
        of_items = [one for one in orders if factors is None or one.partition("=")[0].strip() == left]
        of_factors = [one for one in orders if one not in of_items]
        is_jod = method is MethodChoice.JOD
        columns = (left, right, winner, tie, participant)
        comparisons = read_comparisons(file, *columns, of_items, by, question, same=is_jod)
        design = None if factors is None else read_item_factors(factors, of_factors)
    if (reference or screen or prior is PriorChoice.NONE) and not is_jod:
        raise InputError("--reference, --screen and --prior are for --method jod")
    if method is not None and method in (MethodChoice.JOD, MethodChoice.ELO):
        others = factors, order_effect, firth, crossed, question, equivalence
        if any(others) or intervals is not IntervalsChoice.WALD:
            raise InputError(
                f"--method {method.value} takes no --factors, --order-effect or --firth, and no --crossed, "
                "--question, --equivalence or --intervals; remove them"
            )
    if is_jod:
        anchor, at = _anchor(reference)
        _show_jod(comparisons, (prior.value, anchor, at, bootstrap, screen), file.stem, json)
    elif method is MethodChoice.ELO:
        _show_elo(comparisons, k_factor, bootstrap, by, file.stem, json)
    else:
        if intervals is IntervalsChoice.BOOTSTRAP and not bootstrap:
            raise InputError("--intervals bootstrap needs --bootstrap above 0")
        options = {
            "order_effect": order_effect,
            "firth": firth,
            "factors": design,
            "intervals": intervals.value,
            "samples": bootstrap,
            "crossed": crossed,
            "equivalence": equivalence_bounds(equivalence),
        }
        _show_abilities(comparisons, method, options, by, file.stem, json)


def _show_jod(
    comparisons: "Comparisons",
    options: tuple["Prior", str | None, float, int, bool],
    name: str,
    json: Path | None,
) -> None:
    from analysis.pairs.jod_and_elo import scale_jod
    from analysis.report.choice_tables import jod_tables, jod_text

    with progress_spinner("fitting"):
        scaled = scale_jod(comparisons.by_content(), *options)
    save_json(json, asdict(scaled), comparisons.synthetic)
    show_text(jod_text(scaled, name, comparisons.synthetic))
    show_tables(*jod_tables(scaled, name, comparisons.synthetic))


def _show_elo(
    comparisons: "Comparisons", k_factor: float, samples: int, by: str | None, name: str, json: Path | None
) -> None:
    from analysis.pairs.jod_and_elo import rate_elo
    from analysis.report.choice_tables import elo_table, elo_text

    with progress_spinner("rating"):
        rated = {
            content: rate_elo(own, k_factor, samples) for content, own in comparisons.by_content().items()
        }
    numbers = {content: asdict(result) for content, result in rated.items()}
    separate = comparisons.content is not None
    save_json(json, {"by": by, "contents": numbers} if separate else numbers["all"], comparisons.synthetic)
    for content, result in rated.items():
        title = f"{name}, {content}" if separate else name
        show_text(elo_text(result, title, comparisons.synthetic))
        show_tables(elo_table(result, title, comparisons.synthetic))


def _show_abilities(
    comparisons: "Comparisons",
    method: MethodChoice | None,
    options: dict[str, Any],
    by: str | None,
    name: str,
    json: Path | None,
) -> None:
    """Fit each question and content, and compare the questions."""
    from analysis.pairs.abilities import fit_abilities
    from analysis.pairs.intervals import compare_questions
    from analysis.pairs.likelihood import Method
    from analysis.report.choice_tables import (
        abilities_table,
        contrasts_table,
        effects_table,
        factors_table,
        pairs_text,
        questions_table,
    )

    usual: Method = "davidson" if comparisons.ties else "bradley-terry"
    if options["crossed"] and comparisons.ties:
        usual = "rao-kupper"
    chosen: Method = usual if method is None else method.value  # type: ignore[assignment]
    questions = comparisons.by_question()
    # with crossed effects the contents are levels of one model
    parts = {
        ", ".join(part for part in (question, content) if part): own
        for question, asked in questions.items()
        for content, own in ({"": asked} if options["crossed"] else asked.by_content(alone="")).items()
    }
    with progress_spinner("fitting"):
        fitted = {part: fit_abilities(own, chosen, **options) for part, own in parts.items()}
        compared: tuple[QuestionPair, ...] = ()
        if len(questions) > 1 and options["factors"] is None and not options["crossed"]:
            compared = compare_questions(questions, chosen, order_effect=options["order_effect"])
    numbers = {part: asdict(result) for part, result in fitted.items()}
    document: dict[str, Any] = numbers[""] if list(numbers) == [""] else {"by": by, "contents": numbers}
    if len(questions) > 1:
        document["questions"] = [asdict(pair) for pair in compared]
    save_json(json, document, comparisons.synthetic)
    for part, result in fitted.items():
        title = f"{name}, {part}" if part else name
        show_text(pairs_text(result, title, comparisons.synthetic))
        show_tables(abilities_table(result, title, comparisons.synthetic))
        show_tables(effects_table(result, title, comparisons.synthetic))
        if result.factors:
            show_tables(factors_table(result, title, comparisons.synthetic))
        show_tables(contrasts_table(result, title, comparisons.synthetic))
        show_figure(partial(_draw_items, result, part, comparisons))
    show_tables(questions_table(compared, name, comparisons.synthetic))


def _draw_items(result: "PairsResult", content: str, comparisons: "Comparisons") -> "Picture":
    from analysis.report.figures import draw_abilities

    drawn = draw_abilities(result, comparisons.synthetic, len(comparisons.participants))
    words = f"{drawn.caption}, {content}" if content else drawn.caption
    # The file's name may not hold what a content may be called.
    mark = f"-{sha256(content.encode()).hexdigest()[:8]}" if content else ""
    return replace(drawn, key=f"{drawn.key}{mark}", caption=words)


def _anchor(reference: str | None) -> tuple[str | None, float]:
    """The reference item and its score; `ITEM=10` gives the score."""
    item, _, score = (reference or "").rpartition("=")
    try:
        at = float(score) if item else 0.0
    except ValueError:
        return reference, 0.0
    if not isfinite(at):
        raise InputError(f"--reference should be ITEM or ITEM=10, got '{reference}'")
    return item or reference, at


# `analysis thresholds`.


class FunctionChoice(StrEnum):
    """Shape of the psychometric function."""

    NORMAL = "normal"
    LOGISTIC = "logistic"
    WEIBULL = "weibull"


def thresholds(
    file: Annotated[Path, typer.Argument(help="CSV file, one row per trial.")],
    x: Annotated[str, typer.Option(help="Column of the stimulus, a number.")] = "x",
    response: Annotated[
        str, typer.Option(help="Column of the answer: 1 or 0, yes or no, correct or wrong.")
    ] = "response",
    guess: Annotated[
        float, typer.Option(help="Lower asymptote: 0 for yes/no, 0.5 for two-interval forced choice.")
    ] = 0.0,
    lapse: Annotated[
        str, typer.Option(help="Upper asymptote is 1 minus this: a number, or 'fit' (0 to 0.1).")
    ] = "0",
    function: Annotated[FunctionChoice, typer.Option(help="Shape of the function.")] = FunctionChoice.NORMAL,
    participant: Annotated[
        str | None,
        typer.Option(help="Column with the person: each person is fitted, and their mean is reported."),
    ] = None,
    by: Annotated[str | None, typer.Option(help="Column with the condition: each level is fitted.")] = None,
    second: Annotated[
        str | None,
        typer.Option(
            help="Column of a second stimulus variable (a number); the threshold varies linearly with it."
        ),
    ] = None,
    hierarchical: Annotated[
        bool,
        typer.Option(
            help="One model over all people, whose threshold and spread differ (requires --participant)."
        ),
    ] = False,
    levels: LevelsOption = None,
    json: JsonOption = None,
) -> None:
    """Psychometric functions: thresholds with profile likelihood intervals.

    Examples:

      analysis thresholds trials.csv --x duration --response seen

      analysis thresholds trials.csv --x duration --response correct --guess 0.5 --participant id

      analysis thresholds trials.csv --x duration --participant id --hierarchical --lapse 0.02

      analysis thresholds trials.csv --x contrast --function weibull --lapse fit --by eye

      analysis thresholds trials.csv --x duration --second asymmetry --response correct --participant id
    """
    from analysis.report.choice_tables import (
        means_table,
        people_table,
        population_table,
        threshold_table,
        threshold_text,
    )
    from analysis.thresholds.answers import read_answers
    from analysis.thresholds.people import fit_thresholds, with_population
    from experiments.errors import InputError

    if not 0 <= guess < 1:
        raise InputError(f"expected --guess from 0 to below 1, got {guess:g}")
    upper = _lapse(lapse, guess)
    with progress_spinner("reading trials"):
        answers = read_answers(file, x, response, participant, by, second, levels or ())
    if second is not None:
        if hierarchical:
            raise InputError("--hierarchical takes one stimulus variable; remove --second or --hierarchical")
        _planes(answers, function, guess, upper, (x, second), file.stem, json)
        return
    with progress_spinner("fitting"):
        result = fit_thresholds(answers, function.value, guess, upper)
        if hierarchical:
            result = with_population(result, answers, function.value, guess, upper)
    save_json(json, asdict(result), answers.synthetic)
    show_text(threshold_text(result, file.stem, answers.synthetic))
    if result.population:
        show_tables(population_table(result, file.stem, answers.synthetic))
    if result.means:
        show_tables(means_table(result, file.stem, answers.synthetic))
    show_tables(threshold_table(result, file.stem, answers.synthetic))
    if result.people:
        show_tables(people_table(result, file.stem, answers.synthetic))
    show_figure(partial(_draw_thresholds, result, x, answers.synthetic))


def _draw_thresholds(result: "ThresholdsResult", x: str, synthetic: bool) -> "Picture":
    from analysis.report.pictures import draw_estimates

    rows = [
        (
            name,
            one.threshold,
            nan if one.threshold_ci.low is None else one.threshold_ci.low,
            nan if one.threshold_ci.high is None else one.threshold_ci.high,
        )
        for name, one in result.pooled.items()
    ]
    note = "Bars: 95% profile likelihood intervals, all trials together."
    axis = f"Threshold, in the unit of {x}"
    return draw_estimates("figure-thresholds", "Thresholds", axis, rows, note, synthetic)


def _planes(
    answers: "Answers",
    function: FunctionChoice,
    guess: float,
    lapse: float | None,
    variables: tuple[str, str],
    name: str,
    json: Path | None,
) -> None:
    """Fit the threshold over a second variable, for each condition and person, and show it."""
    from analysis.report.choice_tables import plane_tables, plane_text
    from analysis.thresholds.plane_people import fit_planes
    from experiments.errors import InputError

    if function is FunctionChoice.WEIBULL:
        raise InputError("--second needs --function normal or logistic, because thresholds may be below 0")
    if lapse is None:
        raise InputError("--second needs --lapse as a number; it cannot be fitted together with a tilt")
    with progress_spinner("fitting"):
        result = fit_planes(
            answers, "logistic" if function is FunctionChoice.LOGISTIC else "normal", guess, lapse
        )
    save_json(json, asdict(result), answers.synthetic)
    show_text(plane_text(result, variables, name, answers.synthetic))
    for table in plane_tables(result, variables, name, answers.synthetic):
        show_tables(table)


def _lapse(text: str, guess: float) -> float | None:
    from experiments.errors import InputError

    if text == "fit":
        return None
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < 1 - guess:
        raise InputError(
            f"expected --lapse as a number from 0 to below {1 - guess:g}, or 'fit'; got '{text}'"
        )
    return value
