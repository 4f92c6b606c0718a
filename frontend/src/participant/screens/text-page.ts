/** A page of the declared text: instructions, practice, breaks without a pause. */
import { h } from "../../ui/element";
import { markdown } from "../../ui/markdown";
import { showPage } from "../../ui/page";
import { plugin, STRING, type PluginClass } from "../jspsych";
import type { Session } from "../session";
import { choose, stopButton } from "./support";

export interface TextPageParameters {
  eyebrow: string;
  text: string;
  action: string;
  remarks: string;
}
interface TextPageData {
  read_ms: number;
}

export function textPage(session: Session): PluginClass<TextPageParameters> {
  return plugin<TextPageParameters, TextPageData>({
    name: "text-page",
    parameters: {
      eyebrow: STRING, // small line above the title
      text: STRING, // the text in Markdown
      action: STRING, // label of the button that goes on
      remarks: STRING, // a plain paragraph after the text, or empty
    },
    data: { read_ms: STRING }, // time on the page in ms
    async show(display, { eyebrow, text, action, remarks }) {
      const started = performance.now();
      const footer = h("footer", { class: "actions" });
      const note = remarks ? h("p", {}, remarks) : null;
      const section = showPage(display, { eyebrow, body: [h("div", { class: "prose" }, ...markdown(text), note), footer] });
      section.append(stopButton(session));
      await choose(session, footer, [{ label: action, value: true }]);
      return { read_ms: Math.round(performance.now() - started) };
    },
    simulate: () => ({ read_ms: 0 }),
    act: (display) => display.querySelector<HTMLButtonElement>(".actions .primary")?.click(),
  });
}
