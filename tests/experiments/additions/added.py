"""A kind of trial, a type of scale or field, a language: added as one would, by new files and edits.

The files of the kind are in `word_choice`, at their places in the tree.
"""

from pathlib import Path
from typing import NamedTuple

from tests.conftest import REPOSITORY


class Edit(NamedTuple):
    """A text of an existing file, and the text that replaces it."""

    before: str
    after: str


_KIND_FOLDER = Path(__file__).parent / "word_choice"
KIND: dict[str, str | Edit] = {
    path.relative_to(_KIND_FOLDER).as_posix(): path.read_text(encoding="utf-8")
    for path in sorted(_KIND_FOLDER.rglob("word_choice*")) + sorted(_KIND_FOLDER.rglob("*.ts"))
    if path.is_file()
}
"""A forced choice of two words after a clip."""

MAGNITUDE = '''\
class Magnitude(Scale):
    """A number typed into a box, from 0 to `maximum`."""

    type: Literal["magnitude"] = "magnitude"
    """Names this type of scale."""
    minimum: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    """The smallest number that is taken."""
    maximum: Annotated[float, Field(gt=0, le=1e6)] = 1000.0
    """The largest number that is taken."""
    unit: Translated
    """What stands behind the box."""

    @property
    def lowest(self) -> float:
        """The smallest number."""
        return self.minimum

    @property
    def highest(self) -> float:
        """The largest number."""
        return self.maximum

    @property
    def ends(self) -> tuple[Translated, Translated]:
        """The unit, at both ends."""
        return (self.unit, self.unit)

    def texts(self) -> Iterator[tuple[str, Translated]]:
        """The unit too."""
        yield from super().texts()
        yield "unit", self.unit
'''

MAGNITUDE_WIDGET = """\
/** A number that is typed. */
import { pick } from "../../../i18n";
import { h } from "../../../ui/element";
import type { Ask, Widget } from "../../kinds/clip_rating/answer";

export function widget({ scale, question, language, choose, enter }: Ask): Widget {
  if (scale.type !== "magnitude") throw new Error(`expected a magnitude, got ${scale.type}`);
  const input = h("input", { type: "text", inputmode: "numeric", "aria-labelledby": question });
  input.addEventListener("input", (event) => choose(Number(input.value), event.timeStamp));
  input.addEventListener("keydown", (event) => {
    if (event.key === "Enter") enter();
  });
  return {
    parts: [input, h("span", {}, pick(scale.unit, language))],
    settles: false,
    show: (value) => void (input.value = value === null ? "" : String(value)),
    pressed: () => null,
    focus: () => input.focus(),
  };
}
"""

SCALE: dict[str, str | Edit] = {
    "experiments/declaration/clip_rating.py": Edit(
        "AnyScale = Annotated[Points |",
        MAGNITUDE + "\n\nAnyScale = Annotated[Magnitude | Points |",
    ),
    "frontend/src/participant/trials/scales/magnitude.ts": MAGNITUDE_WIDGET,
    "experiments/kinds/clip_rating.py": Edit(
        'not_applicable = { en = "I cannot say" }\n',
        'not_applicable = { en = "I cannot say" }\n\n[[trial.scales]]\nname = "speed"\ntype = "magnitude"\n'
        'minimum = 0.0\nmaximum = 500.0\nunit = { en = "ms" }\nreverse = false\n'
        'question = { en = "How long did it take?" }\nnot_applicable = { en = "I cannot say" }\n',
    ),
    "docs/reference/trials/clip_rating.md": Edit(
        '| `type = "slider"` | from',
        '| `type = "magnitude"` | a number that is typed |\n| `type = "slider"` | from',
    ),
}

DECIMAL = '''\
class DecimalField(Question):
    """A number with a fraction, such as a dioptre."""

    type: Literal["decimal"] = "decimal"
    """Names this type of field."""
    minimum: float
    """Smallest answer taken."""
    maximum: float
    """Largest answer taken."""

    screened_by: ClassVar = "limits"
    example: ClassVar = """\\
type = "decimal"
name = "dioptres"
label = { en = "How strong are your glasses?" }
help = { en = "In dioptres" }
required = false
minimum = -20.0
maximum = 20.0
"""

    def _problem(self, value: object) -> str | None:
        fits = isinstance(value, int | float) and self.minimum <= value <= self.maximum
        return None if fits else f"expected a number from {self.minimum} to {self.maximum}, got {value!r}"

    def simulated(self, rng: random.Random, /) -> float:
        """Any number of them."""
        return round(rng.uniform(self.minimum, self.maximum), 2)

    def columns(self, name: str, asked: str, language: str) -> Mapping[str | None, Column]:
        """The number."""
        return {None: Column(name, "number", asked, minimum=self.minimum, maximum=self.maximum)}
'''

DECIMAL_CONTROL = """\
/** A number with a fraction. */
import { h } from "../../../ui/element";
import type { TypeOfField } from "./field";

export const type: TypeOfField<"decimal"> = {
  control({ field: { minimum, maximum }, t, id }) {
    const node = h("input", { id, type: "text", inputmode: "decimal", class: "short" });
    const answer = (): number | null => (node.value.trim() === "" ? null : Number(node.value));
    const good = (value: number | null): boolean => value === null || (value >= minimum && value <= maximum);
    const fault = (): string | null => (good(answer()) ? null : t("form_number", { minimum, maximum }));
    return { node, grouped: false, answer, fault };
  },
  simulated: ({ minimum }) => minimum,
};
"""

FIELD: dict[str, str | Edit] = {
    "experiments/declaration/forms.py": Edit(
        "FormField = Annotated[\n",
        DECIMAL + "\n\nFormField = Annotated[\n    DecimalField |\n",
    ),
    "frontend/src/participant/screens/fields/decimal.ts": DECIMAL_CONTROL,
}

ENGLISH = REPOSITORY / "frontend/src/i18n/languages/en.json"
SWEDISH = ENGLISH.read_text(encoding="utf-8").replace('"Continue"', '"Fortsätt"', 1)
"""Swedish, one sentence of it."""

SWEDISH_CHECKS = """\
# Words of motion checks in Swedish, a sentence of them.

[digit]
question = "Vilken siffra såg du?"
"""

LANGUAGE: dict[str, str | Edit] = {
    "experiments/check_words/sv.toml": SWEDISH_CHECKS,
    "frontend/src/i18n/languages/sv.json": SWEDISH,
}

COLUMN: dict[str, str | Edit] = {
    "experiments/kinds/clip_rating.py": Edit(
        """
        member="rt",
    ),
)
""",
        """
        member="rt",
    ),
    Column(
        "comment_length",
        "integer",
        "Characters of the comment.",
        minimum=0,
        source="length(t.comment)",
    ),
)
""",
    )
}
"""A column of the view of ratings; no migration and nothing else goes with it."""
