"""The smaller tables of a study: assignment, blocks, groups, display, session, texts, analysis, data."""

from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from experiments.checks import CHECK_KINDS, CheckName
from experiments.declaration.base import Declaration, Name, Translated, refuse_repeats
from experiments.rules import WarningRule

# The analysis, fixed before the data.


class AnalysisPlan(Declaration):
    """The analysis plan: factor order, the test in the table, and the pairwise comparisons. It is fixed
    before data collection."""

    kind: Literal["within_anova"] = "within_anova"
    """Analysis of variance of the participants' cell means, with repeated measures on within-participant
    factors."""
    factors: tuple[Name, ...] = ()
    """Factors in the order of the tables. Ratings are averaged over factors not listed. Leave empty to use
    all."""
    statistic: Literal["multivariate", "univariate"] = "multivariate"
    """Test printed in tables: multivariate (sphericity is not required), or univariate with the
    Greenhouse-Geisser correction. The JSON output contains both."""
    pairs: tuple[Name, ...] = ()
    """Factors whose levels the report compares pairwise. Leave empty to use every factor of the analysis. p
    values are reported uncorrected and with Bonferroni and Holm corrections."""
    table: Literal["two_level_factors", "pairs_and_interactions", "one_factor"] = "two_level_factors"
    """Layout of the table: one row per effect, pairs next to interactions, or one factor."""


# Who sees which of the clips.


class Assignment(Declaration):
    """Which clips each participant sees. Without a key, everyone sees every clip.

    Slots are assigned in turn. If a participant drops out or is screened out, the next participant takes the
    slot.
    """

    clips_per_cell: Annotated[int, Field(ge=1, le=1000)] | None = None
    """Clips of each cell that a participant sees. All cells use the same exemplar numbers, so that cells are
    compared over the same blinks. Clips are balanced over participants to within one."""
    lists: tuple[Annotated[tuple[str, ...], Field(min_length=1)], ...] = ()
    """Lists of clips, assigned to participants in turn. A clip is written as its cell and exemplar:
    `"SL/30/1"`."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if self.clips_per_cell is not None and self.lists:
            raise ValueError("expected `clips_per_cell` or `lists`, got both; remove one of them")
        for number, clips in enumerate(self.lists, start=1):
            repeated = sorted({clip for clip in clips if clips.count(clip) > 1})
            if repeated:
                raise ValueError(f"list {number}: expected each clip once, got '{repeated[0]}' twice")
        return self


# How a participant's trials are divided into blocks, and the practice before them.


class Blocks(Declaration):
    """How a participant's trials are divided into blocks.

    `split_by` makes one block per level of a factor; without it, a block contains every clip. `repeats` shows
    each block several times. `order` is determined per participant: `random` shuffles the blocks,
    `alternating` cycles through the levels from a random (or counterbalanced) start, `counterbalanced`
    balances block orders over participants, and `fixed` keeps the declared order.
    """

    split_by: Name | None = None
    """Factor whose levels each make one block. If empty, every block contains all clips."""
    repeats: Annotated[int, Field(ge=1, le=20)] = 1
    """How often each block is shown. A participant's cell mean is the mean over the repeats."""
    order: Literal["random", "alternating", "counterbalanced", "fixed"] = "random"
    """Order of the blocks. `random`: shuffled per participant. `alternating`: cycles through the levels.
    `counterbalanced`: balanced over participants (all orders up to five blocks, a balanced Latin square for
    more). `fixed`: as declared."""
    trial_order: Literal["random", "fixed"] = "random"
    """Order of the clips in a block: shuffled per participant, or cell by cell as declared."""
    break_seconds_min: Annotated[int, Field(ge=0, le=600)] = 0
    """Minimum length of a break between blocks, in seconds. Participants may take longer."""


class Practice(Declaration):
    """Practice trials before the first block. Their clips are drawn from all cells by the seed of the run."""

    trials: Annotated[int, Field(ge=0, le=50)] = 4
    """Number of practice trials. They are stored with kind `practice` and never analyzed."""


# The metadata of a study's data when they are shared.

Licence = Annotated[str, StringConstraints(pattern=r"^(https?://\S+|[A-Za-z0-9][A-Za-z0-9.+-]{1,60})$")]
"""An SPDX identifier such as `CC-BY-4.0`, or the URL of a license text."""

SPDX_PAGE = "https://spdx.org/licenses/{}"


class Creator(Declaration):
    """A person or institution that made the data."""

    name: Annotated[str, StringConstraints(min_length=1, max_length=200)]
    """Name as it should be cited."""
    orcid: Annotated[str, StringConstraints(pattern=r"^\d{4}-\d{4}-\d{4}-\d{3}[\dX]$")] | None = None
    """ORCID of a person, as four groups of four digits."""
    affiliation: str = ""
    """Where the person works."""

    @property
    def orcid_page(self) -> str | None:
        """The ORCID as a URL."""
        return f"https://orcid.org/{self.orcid}" if self.orcid else None


class Dataset(Declaration):
    """Authors and license of the data. They are included in Psych-DS datasets and capsules."""

    creators: tuple[Creator, ...] = ()
    """Authors to cite for the data, in order."""
    licence: Licence | None = None
    """License under which the data are shared. Without a license, nobody else may use them."""
    description: str = ""
    """Description of the data in a few sentences. If empty, the title is used."""
    keywords: tuple[str, ...] = ()
    """Keywords for finding the data, in addition to the factor labels."""

    @property
    def licence_page(self) -> str | None:
        """The license as a URL."""
        if self.licence is None or self.licence.startswith("http"):
            return self.licence
        return SPDX_PAGE.format(self.licence)

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        names = [creator.name for creator in self.creators]
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"creators: expected each name once, got '{repeated[0]}' twice")
        return self


# How a clip must appear, and the requirements for the device.

PHONE_PX = ((390, 660), (840, 340))
"""Size of the page area on a typical phone, in portrait and landscape, in CSS pixels."""


class Display(Declaration):
    """How the clip must appear: size on the screen, background, and requirements for the device."""

    inter_ocular_mm: Annotated[float, Field(gt=0, le=500)] = 60.0
    """Distance between the centers of the eyes on the screen, in mm. Calibration converts it to pixels."""
    calibrate: Literal["required", "optional", "off"] = "required"
    """Whether participants match a card's outline to measure the pixels per mm of their screen. Without
    calibration, one pixel of the clip is one pixel of the screen, and `px_per_mm` is empty in the data."""
    calibration_repeats: Annotated[int, Field(ge=2, le=6)] = 2
    """How often the size is measured, each time from a different starting size. If measurements differ too
    much, up to two more follow. Their spread is `calibration_spread` in the data."""
    recheck_size: bool = False
    """Repeats the measurement in each break. A difference of more than 4% leads to a new calibration."""
    viewing_distance: bool = False
    """Adds the blind-spot test. It estimates `viewing_distance_mm` from where a dot disappears."""
    right_to_left_scales: Literal["mirrored", "same"] = "mirrored"
    """In right-to-left languages: whether scales are mirrored, with the lowest point on the right, or stay as
    in other languages. Digit keys work the same way; arrow keys follow the screen."""
    full_screen: bool = True
    """Asks for full screen before the first trial, and again if the participant leaves it."""
    background: Annotated[str, Field(pattern=r"^#[0-9a-f]{6}$")] = "#808080"
    """Color of the page around the clip."""
    minimum_width_px: Annotated[int, Field(ge=0)] = 800
    """Minimum window width for starting a run, in CSS pixels."""
    minimum_height_px: Annotated[int, Field(ge=0)] = 500
    """Minimum window height for starting a run, in CSS pixels."""
    allow_touch: bool = True
    """Allows phones and tablets (devices with a touch screen and no mouse). Off: they cannot be used."""
    sync_patch: bool = False
    """Draws a square in the lower left corner of the clip that encodes the frame number. A photodiode or a
    phone camera can read it (`stimuli scope`). Use it to measure a setup, not with participants."""

    @property
    def turned_away(self) -> str:
        """Which devices cannot take part, in a sentence; empty if phones can."""
        needed = (self.minimum_width_px, self.minimum_height_px)
        if not self.allow_touch:
            return (
                "Phones and tablets cannot be used: the study does not allow devices with a touch screen and "
                "no mouse."
            )
        if any(needed[0] <= width and needed[1] <= height for width, height in PHONE_PX):
            return ""
        (width, height), _ = PHONE_PX
        return (
            f"Phones cannot be used: the study needs a window of at least {needed[0]} x {needed[1]} px, and "
            f"a phone has about {width} x {height}. To change the minimum width and height, see Screen and "
            f"playback."
        )


# Checks that distinguish people from programs: their content is visible through motion only.


class OtherWay(Declaration):
    """An alternative for people who cannot see a motion check. Their runs are rated at most `unclear`."""

    label: Translated
    """Label of the button that leads to the alternative. It is shown before the clip and with the answers."""
    text: Translated
    """Page after the button, in Markdown. Its button continues the study."""


class CheckWording(Declaration):
    """Your own wording for one kind of check, instead of the built-in wording."""

    check: CheckName
    """The kind of check."""
    question: Translated
    """The question after the clip."""
    choices: tuple[Translated, ...]
    """The answers, in the order of the built-in answers."""


class MotionChecks(Declaration):
    """Short clips between the trials. A digit, a direction or a shape is visible through motion only.

    Each check is a separate trial. It is stored with kind `check` and never analyzed.
    """

    per_block: Annotated[int, Field(ge=0, le=10)] = 0
    """Checks in each block, at random positions but never first."""
    kinds: Annotated[tuple[CheckName, ...], Field(min_length=1, max_length=5)] = ("digit",)
    """Kinds of check. `digit`, `direction` and `shape` use random dots. `first_blink` (a full and a half
    blink) and `first_eye` use the character of the study; two pictures in order can reveal their
    answer."""
    difficulty: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.3
    """From 0 to 1. With dots: the share of dots that do not follow (half of them at 1). With blinks or eyes:
    how similar the two are."""
    contrast: Annotated[float, Field(gt=0, le=1, allow_inf_nan=False)] = 0.6
    """Contrast of the dots against the background of the page, from above 0 to 1."""
    seconds: Annotated[float, Field(ge=1.2, le=6, allow_inf_nan=False)] = 2.4
    """Length of a check's clip."""
    clips: Annotated[int, Field(ge=1, le=500)] = 24
    """How many check clips are made. No participant sees one twice. With more clips, a leaked list of answers
    is less useful."""
    other_way: OtherWay | None = None
    """An alternative for people who cannot see such clips. Without it they can only guess."""
    wording: tuple[CheckWording, ...] = ()
    """Your own questions and answers for kinds of check. Without them, the built-in wording in the
    participant's language is used."""

    @model_validator(mode="after")
    def _as_many_choices(self) -> Self:
        refuse_repeats([words.check for words in self.wording], "wording")
        for words in self.wording:
            count = len(CHECK_KINDS[words.check].choices)
            if len(words.choices) != count:
                raise ValueError(
                    f"wording: expected {count} choices for {words.check}, got {len(words.choices)}"
                )
        return self


class Evidence(Declaration):
    """Checks that distinguish people from programs, in addition to what every page records (page:
    evidence)."""

    online_recruitment: bool = False
    """For participants recruited online. Each run gets at least two motion checks and one attention question,
    at random positions in evenly spaced blocks. Without checks, no run is rated "likely a person". The
    consent page must mention flickering clips; `stimuli checks` makes the clips."""
    motion_checks: MotionChecks = MotionChecks()
    """Checks whose content is visible through motion only."""


# How participants are assigned to the groups of between-participant factors.

FORM = "form:"
GroupName = Annotated[str, StringConstraints(pattern=r"^[^\x00-\x1f]{1,600}$")]
Answer = Annotated[str, StringConstraints(max_length=200)]
Rule = Annotated[str, StringConstraints(pattern=r"^(turn|link|form:[A-Za-z][A-Za-z0-9_]{0,39})$")]


class Groups(Declaration):
    """How participants are assigned to groups: one group per combination of levels of `between` factors.

    A group is named by its levels in factor order, separated by slashes. If a participant drops out or is
    screened out, the next participant of that group takes the slot.
    """

    by: Rule = "turn"
    """`turn`: groups take turns. `link`: each link belongs to a group. `form:question`: the answer to a
    required choice question before the trials decides."""
    quotas: dict[GroupName, Annotated[int, Field(ge=1, le=1_000_000)]] = Field(default_factory=dict)
    """Maximum number of participants per group, by group name. Groups without a quota are unlimited. Pilot
    and live runs are counted separately; simulated runs and previews are not counted."""
    answers: dict[Answer, GroupName] = Field(default_factory=dict)
    """Group of each answer (option value). Needed if the answers are not named like the groups."""

    @property
    def question(self) -> str | None:
        """Name of the question that decides; None if no form does."""
        return self.by.removeprefix(FORM) if self.by.startswith(FORM) else None


# How long personal data are kept.

Days = Annotated[int, Field(ge=1, le=36_500)]


class Retention(Declaration):
    """How long personal data are kept, in days after a visit's last activity.

    The server then erases them automatically within an hour.

    A visit follows the period declared when it began, or a shorter period declared later. Periods without a
    number never end.
    """

    identifiers_days: Days | None = None
    """Days until identifiers are erased: recruiter IDs, other parameters of the link, completion codes and
    labels of personal links. Answers stay, under the pseudonym."""
    unfinished_days: Days | None = None
    """Days until unfinished visits are erased, including their answers."""
    answers_days: Days | None = None
    """Days until every visit is erased, including its answers. An empty row remains for the counts."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.answers_days is None:
            return self
        for name in ("identifiers_days", "unfinished_days"):
            days = getattr(self, name)
            if days is not None and days > self.answers_days:
                raise ValueError(
                    f"{name}: expected at most answers_days ({self.answers_days}), because nothing is left "
                    f"after that; got {days}"
                )
        return self

    def shorter(self, other: "Retention") -> "Retention":
        """The shorter of each period; any period is shorter than none.

        Parameters
        ----------
        other : Retention
            The later declaration.
        """
        periods = {
            name: _shorter(getattr(self, name), getattr(other, name)) for name in type(self).model_fields
        }
        return self.model_copy(update=periods)


def _shorter(one: int | None, other: int | None) -> int | None:
    return min((days for days in (one, other) if days is not None), default=None)


# What happens when a participant returns, and how long a slot is kept.


class Session(Declaration):
    """What happens when a participant returns."""

    resume: Literal["resume", "restart", "block"] = "resume"
    """When a participant returns: continue at the next trial (`resume`), start a new run and withdraw the old
    one (`restart`), or refuse (`block`)."""
    maximum_age_hours: Annotated[float, Field(gt=0)] = 72.0
    """Hours after its start until a run can no longer be resumed."""
    lease_minutes: Annotated[float, Field(gt=0)] = 120.0
    """Minutes of inactivity before an unfinished participant's slot (quota, counterbalancing) is released.
    The answers given so far are kept."""


# The pages of a study in one language.


class Texts(Declaration):
    """The pages of one language, in Markdown."""

    consent: str
    """First page. Nothing about participants is stored before they consent."""
    instructions: str
    """Page before practice: what participants will see, what the question is, and which keys answer it."""
    debrief: str
    """Last page: what the study is about. It is shown only after the last answer."""
    practice: str = ""
    """Page before the practice trials. If empty, it states how many there are and that they do not count."""
    block_break: str = ""
    """Page between blocks. If empty, a short default text is shown."""
    screened_out: str = ""
    """Page for participants whose run a [[screening]] rule ends. If empty, a short default text is shown."""


# Friendly warnings for careless responding, and how a run ends that continues like this.


class Warnings(Declaration):
    """Warnings during the run. After a warning, only later answers count toward the next one."""

    rules: tuple[WarningRule, ...] = ()
    """The rules. Without rules, nobody is warned."""
    maximum: Annotated[int, Field(ge=1, le=10)] = 2
    """Maximum number of warnings per participant."""
    then: Literal["end", "go_on"] = "end"
    """After the last warning, the next lapse ends the run as screened out (`end`) or has no effect
    (`go_on`)."""
    code: Literal["failed_check", "screened_out"] = "failed_check"
    """Which completion code an ended run gets. `screened_out` is used if there is no other. It is never the
    code of a complete run."""
    end_text: Translated = Field(
        default_factory=lambda: {
            "en": "Your answers went on as we had pointed out to you, so the study ends here. What you have "
            "answered is stored.",
            "de": "Ihre Antworten blieben so, wie wir es angesprochen hatten; deshalb endet die Studie "
            "hier. Was Sie geantwortet haben, ist gespeichert.",
        }
    )
    """Text above the last page of a run that warnings ended, in every language."""
