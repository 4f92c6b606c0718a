/** The admin site: theme and providers, then the router. */

import { Alert, Anchor, Badge, createTheme, type CSSVariablesResolver, type MantineColorsTuple, MantineProvider } from "@mantine/core";
import { MutationCache, QueryCache, QueryClient, QueryClientProvider } from "@tanstack/react-query";
import { RouterProvider } from "@tanstack/react-router";
import { lazy, StrictMode, Suspense } from "react";
import { createRoot } from "react-dom/client";
import { Refused, sessionQuery } from "./api";
import { styleNonce } from "./nonce";
import { router } from "./router";
import { loadNotifications } from "./ui/useChange";
import "./mantine.css";
import "@mantine/notifications/styles.css";
import "./admin.css";

// A calm petrol, dark enough for white text at every shade that buttons use.
const petrol: MantineColorsTuple = [
  "#e9f4f6",
  "#d5e5e8",
  "#aacad1",
  "#7badb9",
  "#5595a4",
  "#3c8697",
  "#2b7184",
  "#1f6172",
  "#125464",
  "#014855",
];

const theme = createTheme({
  primaryColor: "petrol",
  primaryShade: { light: 7, dark: 6 },
  autoContrast: true,
  luminanceThreshold: 0.35,
  colors: { petrol },
  fontFamily: "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif",
  headings: { sizes: { h1: { fontSize: "26px", lineHeight: "1.3" }, h2: { fontSize: "20px", lineHeight: "1.35" } } },
  defaultRadius: "sm",
  respectReducedMotion: true,
  components: {
    // A quiet box whose edge says what kind of note it is: the same in light and dark.
    Alert: Alert.extend({
      defaultProps: { variant: "default" },
      styles: (_, { color = "petrol" }) => ({
        root: { borderInlineStart: `4px solid var(--mantine-color-${color}-6)` },
        title: { color: "var(--mantine-color-text)" },
      }),
    }),
    Anchor: Anchor.extend({ defaultProps: { underline: "hover" } }),
    Badge: Badge.extend({ defaultProps: { tt: "none", fw: 600, radius: "sm" } }),
  },
});

/** Links, dimmed and placeholder text dark enough (or light enough) for WCAG's 4.5 : 1. */
const readable: CSSVariablesResolver = () => ({
  variables: {},
  light: { "--mantine-color-dimmed": "#545b62", "--mantine-color-placeholder": "#646b72", "--mantine-color-error": "#c2255c" },
  dark: { "--mantine-color-dimmed": "#a6a7ab", "--mantine-color-placeholder": "#9a9ca1", "--mantine-color-anchor": "#7badb9" },
});

// The admin site: providers, then the router.

const Notifications = lazy(async () => ({ default: (await loadNotifications()).Notifications }));

/** Where the session has ended meanwhile, asking for it again shows the page to sign in. */
function onRefusal(error: Error): void {
  if (error instanceof Refused && error.status === 401) void queries.invalidateQueries({ queryKey: sessionQuery.queryKey });
}

const queries = new QueryClient({
  queryCache: new QueryCache({ onError: onRefusal }),
  mutationCache: new MutationCache({ onError: onRefusal }),
  defaultOptions: { queries: { staleTime: 5_000, retry: (times, error) => !(error instanceof Refused) && times < 2 } },
});

const root = document.getElementById("root");
if (root !== null) {
  createRoot(root).render(
    <StrictMode>
      <MantineProvider theme={theme} cssVariablesResolver={readable} defaultColorScheme="auto" getStyleNonce={styleNonce}>
        <QueryClientProvider client={queries}>
          <Suspense fallback={null}>
            <Notifications position="bottom-right" limit={1} notificationMaxHeight={200} />
          </Suspense>
          <RouterProvider router={router} />
        </QueryClientProvider>
      </MantineProvider>
    </StrictMode>,
  );
}
