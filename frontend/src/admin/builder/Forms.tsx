/** Questionnaires: from the bank, from a file, or made anew. */

import { Button, FileButton, Group, Menu, Stack, Text } from "@mantine/core";
import { downloadText } from "../ui/download";
import { FORMS, inLanguages } from "./bank";
import { isTable, listAt, textAt } from "./data";
import { Field } from "./fields/Field";
import { named } from "./fields/new-names";
import { EXPERIMENT } from "./schema";
import { useBuilderHere } from "./useBuilder";
import { notify } from "../ui/notify";

export function Forms() {
  const builder = useBuilderHere();
  const forms = listAt(builder.data, ["forms"]);
  const add = (form: unknown) => builder.set(["forms"], [...forms, named(inLanguages(form, builder.languages), forms, "form")]);
  const take = async (file: File | null) => {
    if (file === null) return;
    const form = formIn(await file.text());
    if (form === null)
      notify({
        title: "No form in this file",
        message: `Expected a form saved here (JSON with name, title and fields), got ${file.name}.`,
        color: "red",
      });
    else add(form);
  };
  return (
    <Stack>
      <Group gap="xs">
        <Menu position="bottom-start">
          <Menu.Target>
            <Button size="xs">Add from the question bank ▾</Button>
          </Menu.Target>
          <Menu.Dropdown>
            {FORMS.map(({ title, about, form }) => (
              <Menu.Item key={title} onClick={() => add(form)}>
                {title}
                <Text size="xs" c="dimmed">
                  {about}
                </Text>
              </Menu.Item>
            ))}
          </Menu.Dropdown>
        </Menu>
        <FileButton accept=".json,application/json" onChange={(file) => void take(file)}>
          {(props) => (
            <Button size="xs" variant="default" {...props}>
              From a file
            </Button>
          )}
        </FileButton>
        {forms.map((form, index) => (
          <Button
            key={index}
            size="xs"
            variant="default"
            onClick={() => downloadText(`${textAt(form, ["name"])}.json`, JSON.stringify(form, null, 2), "application/json")}
          >
            Save “{textAt(form, ["name"])}” as a file
          </Button>
        ))}
      </Group>
      <Field path={["forms"]} schema={EXPERIMENT.properties?.["forms"] ?? {}} />
    </Stack>
  );
}

function formIn(text: string): unknown {
  try {
    const parsed: unknown = JSON.parse(text);
    return isTable(parsed) && typeof parsed["name"] === "string" && Array.isArray(parsed["fields"]) ? parsed : null;
  } catch {
    return null;
  }
}
