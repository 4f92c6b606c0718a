/** What can be done with one element of a list. */

import { Button, Group } from "@mantine/core";
import { listAt, type Path, withMoved } from "../data";
import { useBuilderHere } from "../useBuilder";
import { named } from "./new-names";

interface Props {
  path: Path;
  title: string;
  count: number;
}

export function ElementButtons({ path, title, count }: Props) {
  const builder = useBuilderHere();
  const list = path.slice(0, -1);
  const position = Number(path.at(-1));
  const change = (to: (elements: unknown[]) => unknown[]) => builder.set(list, to(listAt(builder.data, list)));
  const button = (word: string, does: () => void, disabled = false) => (
    <Button size="compact-xs" variant="default" disabled={disabled} aria-label={`${word} ${title}`} onClick={does}>
      {word}
    </Button>
  );
  return (
    <Group gap={4} wrap="nowrap">
      {button("Up", () => change((elements) => withMoved(elements, position, position - 1)), position === 0)}
      {button("Down", () => change((elements) => withMoved(elements, position, position + 1)), position === count - 1)}
      {button("Copy", () => change((elements) => elements.toSpliced(position + 1, 0, named(elements[position], elements))))}
      {button("Remove", () => change((elements) => elements.toSpliced(position, 1)))}
    </Group>
  );
}
