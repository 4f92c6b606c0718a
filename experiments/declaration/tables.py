"""The smaller tables of a study: assignment, blocks, groups, display, session, texts, analysis, data."""

from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from experiments.checks import CHECK_KINDS, CheckName
from experiments.declaration.base import Declaration, Name, Translated, refuse_repeats
from experiments.rules import WarningRule

# The analysis, fixed before the data.


class AnalysisPlan(Declaration):
    """The analysis fixed before the data: factor order, the test of the table, and the pairs."""

    kind: Literal["within_anova"] = "within_anova"
    """Analysis of variance of participants' cell means, repeated over the factors within participants."""
    factors: tuple[Name, ...] = ()
    """Factors in the order of the tables; over those left out ratings are averaged. Empty takes all."""
    statistic: Literal["multivariate", "univariate"] = "multivariate"
    """Test that tables print: of the multivariate model (no sphericity needed), or univariate with
    Greenhouse-Geisser's correction. The JSON output holds both."""
    pairs: tuple[Name, ...] = ()
    """Factors whose levels the report compares pair by pair; empty takes every factor of the analysis.
    p values are given as they are, and corrected by Bonferroni and by Holm."""
    table: Literal["two_level_factors", "pairs_and_interactions", "one_factor"] = "two_level_factors"
    """Layout of the table: a row an effect, pairs beside interactions, or one factor."""


# Who sees which of the clips.


class Assignment(Declaration):
    """Which clips of their cells participants see; without a key everybody sees every clip.

    Places are dealt in turn: one that is given up, or screened out, goes to the next participant.
    """

    clips_per_cell: Annotated[int, Field(ge=1, le=1000)] | None = None
    """Clips of each cell that a participant sees, with the same exemplar numbers in all cells, so that cells
    are compared over the same blinks. Over participants each clip is seen equally often, give or take one."""
    lists: tuple[Annotated[tuple[str, ...], Field(min_length=1)], ...] = ()
    """Lists of clips, dealt to participants in turn. A clip is written as cell and exemplar: `"SL/30/1"`."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if self.clips_per_cell is not None and self.lists:
            raise ValueError("give `clips_per_cell` or `lists`, not both")
        for number, clips in enumerate(self.lists, start=1):
            repeated = sorted({clip for clip in clips if clips.count(clip) > 1})
            if repeated:
                raise ValueError(f"list {number}: '{repeated[0]}' stands twice in it")
        return self


# How a participant's trials are cut into blocks, and the practice before them.


class Blocks(Declaration):
    """How a participant's trials are cut into blocks.

    `split_by` puts each level of a factor into a block of its own; without it a block holds every clip.
    `repeats` shows each such block that often. `order` is drawn per participant: `random` shuffles the
    blocks, `alternating` cycles through the levels from a random (or counterbalanced) start,
    `counterbalanced` deals block orders evenly over participants, `fixed` keeps the declared order.
    """

    split_by: Name | None = None
    """Factor each level of which makes a block; without it every block holds all clips."""
    repeats: Annotated[int, Field(ge=1, le=20)] = 1
    """How often each block is shown. A participant's cell mean is taken over the repeats."""
    order: Literal["random", "alternating", "counterbalanced", "fixed"] = "random"
    """Order of the blocks: shuffled for each participant, cycling through the levels, orders dealt evenly
    over participants (every order up to five blocks, a balanced Latin square beyond), or as declared."""
    trial_order: Literal["random", "fixed"] = "random"
    """Order of the clips in a block: shuffled for each participant, or cell by cell as declared."""
    break_seconds_min: Annotated[int, Field(ge=0, le=600)] = 0
    """Seconds a break between blocks lasts at least; the participant may take longer."""


class Practice(Declaration):
    """Practice trials before the first block; their clips are drawn over all cells by the run's seed."""

    trials: Annotated[int, Field(ge=0, le=50)] = 4
    """How many practice trials there are. They are stored with kind `practice` and never analysed."""


# What a study's data say of themselves when they are handed on.

Licence = Annotated[str, StringConstraints(pattern=r"^(https?://\S+|[A-Za-z0-9][A-Za-z0-9.+-]{1,60})$")]
"""An SPDX identifier such as `CC-BY-4.0`, or the address of a licence's text."""

SPDX_PAGE = "https://spdx.org/licenses/{}"


class Creator(Declaration):
    """A person or an institution that made the data."""

    name: Annotated[str, StringConstraints(min_length=1, max_length=200)]
    """Name as it is cited."""
    orcid: Annotated[str, StringConstraints(pattern=r"^\d{4}-\d{4}-\d{4}-\d{3}[\dX]$")] | None = None
    """ORCID of a person, as four groups of four digits."""
    affiliation: str = ""
    """Where the person works."""

    @property
    def orcid_page(self) -> str | None:
        """The ORCID as an address."""
        return f"https://orcid.org/{self.orcid}" if self.orcid else None


class Dataset(Declaration):
    """Who made the data and who may do what with them; stands in Psych-DS datasets and capsules."""

    creators: tuple[Creator, ...] = ()
    """Who is cited for the data, in order."""
    licence: Licence | None = None
    """Under which licence the data are handed on. Without it nobody else may use them."""
    description: str = ""
    """What the data are, in some sentences; empty takes the title."""
    keywords: tuple[str, ...] = ()
    """Words under which the data should be found, beside the factors' labels."""

    @property
    def licence_page(self) -> str | None:
        """The licence as an address."""
        if self.licence is None or self.licence.startswith("http"):
            return self.licence
        return SPDX_PAGE.format(self.licence)

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        names = [creator.name for creator in self.creators]
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"creators: '{repeated[0]}' stands twice among them")
        return self


# How a clip must appear, and what the device must offer.

PHONE_PX = ((390, 660), (840, 340))
"""Room of a page on a usual phone, upright and on its side, in CSS pixels."""


class Display(Declaration):
    """How the clip must appear: size on the screen, surround, and what the device must offer."""

    inter_ocular_mm: Annotated[float, Field(gt=0, le=500)] = 60.0
    """Distance between the eyes' centres on the screen, in mm; calibration turns it into pixels."""
    calibrate: Literal["required", "optional", "off"] = "required"
    """Whether the participant fits a card's outline to learn the screen's pixels per mm. Without it clips are
    shown pixel by pixel and `px_per_mm` is empty in the data."""
    calibration_repeats: Annotated[int, Field(ge=2, le=6)] = 2
    """How often the size is measured, each time from another one; what differs too much is measured up to
    twice more. The spread of the repeats is `calibration_spread` in the data."""
    recheck_size: bool = False
    """Asks for one more measurement in each break; one that differs by more than 4% leads to a new
    calibration."""
    viewing_distance: bool = False
    """Adds the blind-spot test, which estimates `viewing_distance_mm` from where a dot vanishes."""
    right_to_left_scales: Literal["mirrored", "same"] = "mirrored"
    """Where a language is read from right to left: whether scales run that way too, their lowest point on the
    right, or stay as in the other languages. Digits answer alike, arrow keys follow what is seen."""
    full_screen: bool = True
    """Asks for full screen before the first trial and again where it was left."""
    background: Annotated[str, Field(pattern=r"^#[0-9a-f]{6}$")] = "#808080"
    """Colour of the page around the clip."""
    minimum_width_px: Annotated[int, Field(ge=0)] = 800
    """Smallest window width, in CSS pixels, in which a run may begin."""
    minimum_height_px: Annotated[int, Field(ge=0)] = 500
    """Smallest window height, in CSS pixels, in which a run may begin."""
    allow_touch: bool = True
    """Lets in devices that have a touch screen and no mouse, phones and tablets. Off: turns them away."""
    sync_patch: bool = False
    """Draws a square into the clip's lower left corner that codes the frame's number, for a photodiode or a
    phone's film (`stimuli scope`). For measuring a set-up, not for participants."""

    @property
    def turned_away(self) -> str:
        """Which devices can take no part, in a sentence; empty where phones can."""
        needed = (self.minimum_width_px, self.minimum_height_px)
        if not self.allow_touch:
            return (
                "Phones and tablets are turned away: devices with a touch screen and no mouse are not let in."
            )
        if any(needed[0] <= width and needed[1] <= height for width, height in PHONE_PX):
            return ""
        (width, height), _ = PHONE_PX
        return (
            f"Phones are turned away: a window of at least {needed[0]} x {needed[1]} px is asked for, and a "
            f"phone has about {width} x {height}. Minimum width and height are under Screen and playback."
        )


# What a study asks for to tell people from programs: checks that show their content by motion alone.


class OtherWay(Declaration):
    """What somebody does who cannot see a motion check. Who takes it is at most `unclear`."""

    label: Translated
    """The button that leads to it, offered before the clip and beside the answers."""
    text: Translated
    """Markdown of the page behind the button; its button goes on with the study."""


class CheckWording(Declaration):
    """The words of one kind of check, in place of the program's own."""

    check: CheckName
    """The kind of check."""
    question: Translated
    """What is asked after the clip."""
    choices: tuple[Translated, ...]
    """The answers in the order of the kind's own."""


class MotionChecks(Declaration):
    """Short clips between the trials in which a digit, a direction or a shape is defined by motion alone.

    Each is asked as a trial of its own, stored with kind `check` and never analysed.
    """

    per_block: Annotated[int, Field(ge=0, le=10)] = 0
    """Checks in each block, at random places but never first."""
    kinds: Annotated[tuple[CheckName, ...], Field(min_length=1, max_length=5)] = ("digit",)
    """Kinds of check: `digit`, `direction` and `shape` of random dots; `first_blink` (a full blink and a half
    one) and `first_eye` in the study's own look, which two pictures in their order give away."""
    difficulty: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.3
    """From 0 to 1: the share of dots that do not follow (half of them at 1); how alike the two blinks are,
    or how close the two eyes."""
    contrast: Annotated[float, Field(gt=0, le=1, allow_inf_nan=False)] = 0.6
    """Contrast of the dots against the page's background, from above 0 to 1."""
    seconds: Annotated[float, Field(ge=1.2, le=6, allow_inf_nan=False)] = 2.4
    """Length of a check's clip."""
    clips: Annotated[int, Field(ge=1, le=500)] = 24
    """How many check clips are made. Nobody sees one twice; the more there are, the less a list of
    their answers is worth."""
    other_way: OtherWay | None = None
    """The way around for people who cannot see such clips; without it they can only guess."""
    wording: tuple[CheckWording, ...] = ()
    """Question and answers of kinds of check, in place of the program's own, which has those of the page."""

    @model_validator(mode="after")
    def _as_many_choices(self) -> Self:
        refuse_repeats([words.check for words in self.wording], "wording")
        for words in self.wording:
            count = len(CHECK_KINDS[words.check].choices)
            if len(words.choices) != count:
                raise ValueError(f"wording: {words.check} has {count} choices, got {len(words.choices)}")
        return self


class Evidence(Declaration):
    """Checks that tell people from programs, in addition to what every page records (page: evidence)."""

    online_recruitment: bool = False
    """For participants recruited online: each run has two motion checks and one attention question at least,
    at random places of evenly spread blocks. Without checks no run is rated likely a person's. Consent must
    mention that clips flicker, and `stimuli checks` makes the clips."""
    motion_checks: MotionChecks = MotionChecks()
    """Checks that show their content by motion alone."""


# How participants come into the groups that the factors between participants make.

FORM = "form:"
GroupName = Annotated[str, StringConstraints(pattern=r"^[^\x00-\x1f]{1,600}$")]
Answer = Annotated[str, StringConstraints(max_length=200)]
Rule = Annotated[str, StringConstraints(pattern=r"^(turn|link|form:[A-Za-z][A-Za-z0-9_]{0,39})$")]


class Groups(Declaration):
    """How participants come into groups: one for each combination of levels of the factors `between` them.

    A group is named by its levels in factor order, joined by slashes. A place in a group that is given up, or
    screened out, goes to the next participant of that group.
    """

    by: Rule = "turn"
    """`turn`: groups take turns. `link`: each link is for a group. `form:question`: the answer to a required
    choice of a form before the trials decides."""
    quotas: dict[GroupName, Annotated[int, Field(ge=1, le=1_000_000)]] = Field(default_factory=dict)
    """Participants a group takes, by its name; a group without a quota takes any number. Pilot and live runs
    are counted apart, those of simulated people and previews not at all."""
    answers: dict[Answer, GroupName] = Field(default_factory=dict)
    """Group of each answer, where answers (the values of the options) are not named as the groups are."""

    @property
    def question(self) -> str | None:
        """Name of the question that decides; None where no form does."""
        return self.by.removeprefix(FORM) if self.by.startswith(FORM) else None


# How long data of persons are kept.

Days = Annotated[int, Field(ge=1, le=36_500)]


class Retention(Declaration):
    """How long data of persons are kept, in days after a visit's last sign of life.

    Then the server erases them by itself, within the hour.

    A visit keeps to what was declared when it began, or to what is declared since where that is shorter. A
    period without a number is without an end.
    """

    identifiers_days: Days | None = None
    """Days after which it is erased who took part: recruiters' ids, what else the address said, completion
    codes and labels of personal links. Answers stay, under the pseudonym."""
    unfinished_days: Days | None = None
    """Days after which visits that were not completed are erased, answers and all."""
    answers_days: Days | None = None
    """Days after which every visit is erased, answers and all; a row without content stays for the counts."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.answers_days is None:
            return self
        for name in ("identifiers_days", "unfinished_days"):
            days = getattr(self, name)
            if days is not None and days > self.answers_days:
                raise ValueError(
                    f"{name} is {days}, but after answers_days ({self.answers_days}) nothing is left; "
                    "expected at most as many"
                )
        return self

    def shorter(self, other: "Retention") -> "Retention":
        """The shorter of each period; one that is declared is shorter than none.

        Parameters
        ----------
        other : Retention
            What is declared since.
        """
        periods = {
            name: _shorter(getattr(self, name), getattr(other, name)) for name in type(self).model_fields
        }
        return self.model_copy(update=periods)


def _shorter(one: int | None, other: int | None) -> int | None:
    return min((days for days in (one, other) if days is not None), default=None)


# What happens when a participant comes back, and for how long a place is kept.


class Session(Declaration):
    """What happens when a participant comes back."""

    resume: Literal["resume", "restart", "block"] = "resume"
    """Coming back goes on at the next trial, begins a new run (the old one is withdrawn), or is refused."""
    maximum_age_hours: Annotated[float, Field(gt=0)] = 72.0
    """Hours after its start at which a run can no longer be taken up again."""
    lease_minutes: Annotated[float, Field(gt=0)] = 120.0
    """Minutes without a sign of life after which an unfinished run's place (quota, counterbalancing slot)
    goes to somebody else. What it answered stays."""


# The pages of a study in one language.


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


# Kind words to who answers without care, and how a run ends that goes on so.


class Warnings(Declaration):
    """Warnings while the run goes on. After a warning was shown, only answers after it count for another."""

    rules: tuple[WarningRule, ...] = ()
    """What is warned of; without rules nobody is warned."""
    maximum: Annotated[int, Field(ge=1, le=10)] = 2
    """Warnings that a participant gets."""
    then: Literal["end", "go_on"] = "end"
    """What a lapse after the last warning does: it ends the run as screened out, or nothing more happens."""
    code: Literal["failed_check", "screened_out"] = "failed_check"
    """Which of the recruiter's codes a run gets that ended so; that of screened out where there is no other.
    Never the code of a complete run."""
    end_text: Translated = Field(
        default_factory=lambda: {
            "en": "Your answers went on as we had pointed out to you, so the study ends here. What you have "
            "answered is stored.",
            "de": "Ihre Antworten blieben so, wie wir es angesprochen hatten; deshalb endet die Studie "
            "hier. Was Sie geantwortet haben, ist gespeichert.",
        }
    )
    """What stands above the last page of a run that ended so, in every language."""
