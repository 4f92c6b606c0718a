/** The site's one kind of table: declared columns, pages where it is long, columns that a phone leaves out. */

import { Pagination, Stack, Table, Text } from "@mantine/core";
import { type ReactNode, useState } from "react";

export interface Column<Row> {
  title: string;
  cell: (row: Row) => ReactNode;
  /** Figures of equal width. */
  number?: boolean;
  /** Left out on narrow screens. */
  wide?: boolean;
  /** Long text that may break; other cells stay on one line. */
  wrap?: boolean;
}

interface Props<Row> {
  columns: readonly Column<Row>[];
  rows: readonly Row[];
  rowKey: (row: Row) => string | number;
  /** What replaces a table without rows. */
  empty: string;
  label?: string;
  dense?: boolean;
  /** False where the page brings its own way to more rows. */
  paged?: boolean;
}

const ROWS_A_PAGE = 50;

export function DataTable<Row>({ columns, rows, rowKey, empty, label, dense = false, paged = true }: Props<Row>) {
  const [page, setPage] = useState(1);
  if (rows.length === 0) return <Text c="dimmed">{empty}</Text>;
  const pages = paged ? Math.ceil(rows.length / ROWS_A_PAGE) : 1;
  const current = Math.min(page, pages);
  const shown = paged ? rows.slice((current - 1) * ROWS_A_PAGE, current * ROWS_A_PAGE) : rows;
  return (
    <Stack gap="sm">
      {/* Reached by keyboard, so that it can be scrolled where it is wider than the screen. */}
      <div className="scroll-x" tabIndex={0} role="group" aria-label={label ?? "Table"}>
        <Table highlightOnHover verticalSpacing={dense ? 4 : "xs"} aria-label={label}>
          <Table.Thead>
            <Table.Tr>
              {columns.map((column) => (
                <Table.Th key={column.title} className={classOf(column)}>
                  {column.title}
                </Table.Th>
              ))}
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {shown.map((row) => (
              <Table.Tr key={rowKey(row)}>
                {columns.map((column) => (
                  <Table.Td key={column.title} className={classOf(column)}>
                    {column.cell(row)}
                  </Table.Td>
                ))}
              </Table.Tr>
            ))}
          </Table.Tbody>
        </Table>
      </div>
      {pages > 1 && <Pages total={pages} value={current} onChange={setPage} />}
    </Stack>
  );
}

function Pages(props: { total: number; value: number; onChange: (page: number) => void }) {
  return <Pagination size="sm" {...props} getControlProps={(control) => ({ "aria-label": `${control} page` })} />;
}

function classOf<Row>({ number, wide, wrap }: Column<Row>): string {
  return [number && "number", wide && "only-wide", wrap ? "wrap-anywhere" : "one-line"].filter(Boolean).join(" ");
}
