import { Group, SegmentedControl, Select, Stack } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { studyQuery } from "../queries";
import { Answer } from "../ui/Answer";
import { onDemand } from "../ui/onDemand";
import { SeriesChooser } from "../ui/SeriesChooser";
import { type DataOrigin, ORIGINS, originOf } from "./origins";
import { MethodsCard } from "./MethodsCard";
import { NoAnswers } from "./NoAnswers";
import { Reports } from "./Reports";

const OfKind = onDemand(async () => (await import("./OfKind")).OfKind);

export function ResultsTab() {
  const { study = "" } = useParams({ strict: false });
  const detail = useQuery(studyQuery(study)).data;
  const [chosen, setOrigin] = useState<DataOrigin | null>(null);
  const [series, setSeries] = useState<number | null>(null);
  const [scale, setScale] = useState<string | null>(null);
  const origin = chosen ?? (detail?.summary.status === "pilot" ? "pilot" : "participant");
  const results = useQuery({
    queryKey: ["results", study, origin, series, scale],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/results", { params: { path: { study }, query: { origin, series, scale } } })),
    refetchInterval: 15_000,
  });
  return (
    <Stack>
      <Group justify="space-between">
        <SegmentedControl aria-label="Data of" value={origin} onChange={(word) => setOrigin(originOf(word))} data={ORIGINS} />
        <SeriesChooser
          every={detail?.series}
          chosen={series}
          choose={(number) => {
            setSeries(number);
            setScale(null);
          }}
          without="series of the active version"
        />
        {results.data?.kind === "clip_rating" && (
          <ScaleChooser scales={results.data.scales} chosen={results.data.scale.name} choose={setScale} />
        )}
      </Group>
      <Answer of={results}>
        {(data) =>
          data.ratings === 0 ? (
            <NoAnswers
              origin={origin}
              runs={detail?.series.find((one) => one.number === data.series)?.runs ?? {}}
              every={detail?.series ?? []}
              series={data.series}
              choose={setOrigin}
              chooseSeries={setSeries}
            />
          ) : (
            <OfKind study={study} data={data} factors={detail?.design.factors ?? []} />
          )
        }
      </Answer>
      <Reports study={study} origin={origin} series={series} />
      <MethodsCard study={study} origin={origin} series={series} every={detail?.series ?? []} choose={setSeries} />
    </Stack>
  );
}

interface ChooserProps {
  scales: Schemas["ResultScale"][];
  chosen: string;
  choose: (name: string | null) => void;
}

/** The scales of a study that has several; one that is reverse-keyed says so, its answers are as they were given. */
function ScaleChooser({ scales, chosen, choose }: ChooserProps) {
  if (scales.length < 2) return null;
  const data = scales.map(({ name, reverse }) => ({ value: name, label: reverse ? `${name} (reverse-keyed)` : name }));
  return <Select aria-label="Scale" w={240} allowDeselect={false} value={chosen} onChange={choose} data={data} />;
}
