/** Usual questionnaires and consent texts, in English and German, to begin from. */

import type { Data } from "./data";

type Words = Record<string, string>;
const say = (en: string, de: string): Words => ({ en, de });
const option = (value: string, en: string, de: string): Data => ({ value, label: say(en, de) });

const AGE: Data = {
  type: "number",
  name: "age",
  label: say("Your age in years", "Ihr Alter in Jahren"),
  required: true,
  minimum: 18,
  maximum: 120,
};
const GENDER: Data = {
  type: "choice",
  name: "gender",
  label: say("Your gender", "Ihr Geschlecht"),
  options: [
    option("woman", "Woman", "Frau"),
    option("man", "Man", "Mann"),
    option("other", "Another", "Anderes"),
    option("not_said", "I would rather not say", "Keine Angabe"),
  ],
};
const EYESIGHT: Data = {
  type: "choice",
  name: "vision",
  label: say("Your eyesight at this screen", "Ihre Sehkraft an diesem Bildschirm"),
  required: true,
  options: [
    option("normal", "Normal without glasses", "Normal ohne Brille"),
    option("corrected", "Normal with glasses or lenses", "Normal mit Brille oder Linsen"),
    option("impaired", "Impaired", "Eingeschränkt"),
  ],
};
const COLOUR_VISION: Data = {
  type: "choice",
  name: "colour_vision",
  label: say("Do you have a colour vision deficiency?", "Haben Sie eine Farbsehschwäche?"),
  options: [option("no", "No", "Nein"), option("yes", "Yes", "Ja"), option("unknown", "I do not know", "Weiß ich nicht")],
};
const WEARS: Data = {
  type: "choice",
  name: "wears",
  label: say("What are you wearing now?", "Was tragen Sie gerade?"),
  options: [
    option("nothing", "Neither", "Weder noch"),
    option("glasses", "Glasses", "Brille"),
    option("lenses", "Contact lenses", "Kontaktlinsen"),
  ],
};

/** The ten statements of the System Usability Scale (Brooke, 1996); odd ones speak for the system, even ones against. */
const SUS = [
  say("I think that I would like to use this system frequently", "Ich denke, dass ich dieses System gerne häufig nutzen würde"),
  say("I found the system unnecessarily complex", "Ich fand das System unnötig komplex"),
  say("I thought the system was easy to use", "Ich fand das System einfach zu nutzen"),
  say(
    "I think that I would need the support of a technical person to be able to use this system",
    "Ich denke, dass ich technische Hilfe brauchen würde, um das System zu nutzen",
  ),
  say("I found the various functions in this system were well integrated", "Ich fand die Funktionen des Systems gut integriert"),
  say("I thought there was too much inconsistency in this system", "Ich fand das System zu uneinheitlich"),
  say(
    "I would imagine that most people would learn to use this system very quickly",
    "Ich denke, dass die meisten Menschen das System schnell zu nutzen lernen",
  ),
  say("I found the system very cumbersome to use", "Ich fand das System sehr umständlich zu nutzen"),
  say("I felt very confident using the system", "Ich fühlte mich bei der Nutzung des Systems sehr sicher"),
  say(
    "I needed to learn a lot of things before I could get going with this system",
    "Ich musste viel lernen, bevor ich mit dem System arbeiten konnte",
  ),
];
const AGREE = { low: say("Strongly disagree", "Stimme gar nicht zu"), high: say("Strongly agree", "Stimme voll zu") };

function likert(name: string, label: Words, points: number): Data {
  return { type: "likert", name, label, required: true, points, ...AGREE };
}

export interface BankForm {
  title: string;
  about: string;
  form: Data;
}

export const FORMS: readonly BankForm[] = [
  {
    title: "Demographics",
    about: "Age, gender, eyesight",
    form: { name: "demographics", when: "before", title: say("About you", "Über Sie"), fields: [AGE, GENDER, EYESIGHT] },
  },
  {
    title: "Vision",
    about: "Eyesight, glasses worn now, colour vision",
    form: { name: "vision", when: "before", title: say("Your eyesight", "Ihre Sehkraft"), fields: [EYESIGHT, WEARS, COLOUR_VISION] },
  },
  {
    title: "Usability (SUS)",
    about: "Ten statements of the System Usability Scale, five points each",
    form: {
      name: "sus",
      when: "after",
      title: say("How was the system?", "Wie war das System?"),
      fields: SUS.map((label, index) => likert(`sus_${index + 1}`, label, 5)),
    },
  },
  {
    title: "Agreement grid",
    about: "Three statements of seven points, to be written over",
    form: {
      name: "agreement",
      when: "after",
      title: say("How much do you agree?", "Wie sehr stimmen Sie zu?"),
      fields: [1, 2, 3].map((number) => likert(`statement_${number}`, say(`Statement ${number}`, `Aussage ${number}`), 7)),
    },
  },
  {
    title: "Comments",
    about: "Free text after the last trial",
    form: {
      name: "comments",
      when: "after",
      title: say("Anything else?", "Noch etwas?"),
      fields: [
        {
          type: "text",
          name: "comment",
          label: say("What did you notice, and was anything unclear?", "Was ist Ihnen aufgefallen, war etwas unklar?"),
        },
        {
          type: "choice",
          name: "trouble",
          label: say("Did the clips play smoothly?", "Liefen die Filme flüssig?"),
          options: [option("yes", "Yes", "Ja"), option("mostly", "Mostly", "Meistens"), option("no", "No", "Nein")],
        },
      ],
    },
  },
  {
    title: "Consent, itemized",
    about: "Each point to be agreed to, stored as an answer",
    form: {
      name: "consent_points",
      when: "before",
      title: say("Please agree to each point", "Bitte stimmen Sie jedem Punkt zu"),
      fields: [
        ["informed", say("I have read and understood the information", "Ich habe die Informationen gelesen und verstanden")] as const,
        [
          "voluntary",
          say("I take part voluntarily and may stop at any time", "Ich nehme freiwillig teil und kann jederzeit aufhören"),
        ] as const,
        [
          "sharing",
          say("My answers may be published without my name", "Meine Antworten dürfen ohne meinen Namen veröffentlicht werden"),
        ] as const,
      ].map(([name, label]) => ({
        type: "multiple_choice",
        name,
        label,
        required: true,
        options: [option("agreed", "I agree", "Ich stimme zu")],
      })),
    },
  },
];

/** `form` in the languages of the study; in English where the bank lacks one. */
export function inLanguages(form: unknown, languages: readonly string[]): unknown {
  if (Array.isArray(form)) return (form as unknown[]).map((inner) => inLanguages(inner, languages));
  if (typeof form !== "object" || form === null) return form;
  const table = form as Data;
  if (typeof table["en"] === "string") return Object.fromEntries(languages.map((language) => [language, table[language] ?? table["en"]]));
  return Object.fromEntries(Object.entries(table).map(([key, value]) => [key, inLanguages(value, languages)]));
}

export const CONSENTS: Record<string, Record<string, string>> = {
  en: {
    "Online, anonymous": `# [Title]

You are invited to a study on [topic]. You will watch short clips and rate them. It takes about [minutes] minutes.

- Taking part is voluntary. If you would rather not, choose *I do not agree*. You can stop at any time with *Stop*, without giving a reason.
- We store your answers, how the clips were shown on your screen, and what you enter in questionnaires.
- We store neither your name nor your internet address.

Responsible: [name, institution, e-mail]. Ethics approval: [number].
`,
    "Data will be published": `# [Title]

You are invited to a study on [topic]. You will watch short clips and rate them. It takes about [minutes] minutes.

- Taking part is voluntary. If you would rather not, choose *I do not agree*. You can stop at any time with *Stop*; send us the code of your run, and we will delete its data.
- Answers are published in a public archive, without anything that names you. What is published cannot be taken back.
- We store neither your name nor your internet address.

Responsible: [name, institution, e-mail]. Ethics approval: [number]. Data protection: [e-mail].
`,
    "Course credit": `# [Title]

You are invited to a study on [topic], for [amount] of course credit. It takes about [minutes] minutes.

- Taking part is voluntary. You get the credit for the time you gave even if you stop early: write to [e-mail].
- Your id of the participant pool is stored to grant the credit, and deleted on [date].
- We store your answers and how the clips were shown on your screen.

Responsible: [name, institution, e-mail]. Ethics approval: [number].
`,
  },
  de: {
    "Online, anonym": `# [Titel]

Sie sind zu einer Studie über [Thema] eingeladen. Sie sehen kurze Filme und bewerten sie. Das dauert etwa [Minuten] Minuten.

- Die Teilnahme ist freiwillig. Wenn Sie nicht möchten, wählen Sie *Ich bin nicht einverstanden*. Mit *Aufhören* können Sie jederzeit ohne Angabe von Gründen aufhören.
- Wir speichern Ihre Antworten, wie die Filme auf Ihrem Bildschirm gezeigt wurden und Ihre Angaben in Fragebögen.
- Wir speichern weder Ihren Namen noch Ihre Internetadresse.

Verantwortlich: [Name, Einrichtung, E-Mail]. Ethikvotum: [Nummer].
`,
  },
};

/** A template of the consent with what the study itself says in the place of its marks. */
export function withKnown(text: string, { title, minutes }: { title: string; minutes: string }): string {
  const filled = (of: string, mark: RegExp, words: string) => (words === "" ? of : of.replaceAll(mark, () => words));
  const worded = minutes === "1" ? text.replaceAll("[minutes] minutes", "1 minute").replaceAll("[Minuten] Minuten", "1 Minute") : text;
  return filled(filled(worded, /\[Tit(?:le|el)\]/g, title), /\[[mM]inut(?:es|en)\]/g, minutes);
}

/** The marks of a template that nobody has filled in. */
export const unfilledMarks = (text: string) => [...new Set(text.match(/\[[^[\]\n]+\](?!\()/g) ?? [])];
