import { Badge, Card, Text, Title } from "@mantine/core";
import { languageName, SHIPPED } from "../../i18n";
import { reviewed } from "../../i18n/reviewed";
import { DataTable } from "../ui/DataTable";

/** Languages in which the participants' page itself speaks, and whether a person has read what it says. */
export function PageLanguages() {
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="xs">
        The page&rsquo;s own words
      </Title>
      <Text size="sm" mb="sm">
        Buttons, hints and errors of the participants&rsquo; page. In any other language they are English; your own texts stay yours. Read
        an unreviewed language, or have it read, before people take part in it.
      </Text>
      <DataTable
        label="Languages of the page"
        rows={SHIPPED}
        rowKey={(tag) => tag}
        empty="None."
        columns={[
          { title: "Language", cell: (tag) => <span lang={tag}>{languageName(tag)}</span> },
          { title: "Tag", cell: (tag) => <code>{tag}</code> },
          {
            title: "Read by",
            cell: (tag) => {
              const by = reviewed[tag];
              return by ? `${by.by}, ${by.on}` : <Badge variant="default">unreviewed</Badge>;
            },
          },
        ]}
      />
    </Card>
  );
}
