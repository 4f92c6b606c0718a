/** The admin site: providers, then the router. */

import "./mantine.css";
import "@mantine/notifications/styles.css";
import "./admin.css";
import { MantineProvider } from "@mantine/core";
import { MutationCache, QueryCache, QueryClient, QueryClientProvider } from "@tanstack/react-query";
import { RouterProvider } from "@tanstack/react-router";
import { lazy, StrictMode, Suspense } from "react";
import { createRoot } from "react-dom/client";
import { Refused } from "./api";
import { styleNonce } from "./nonce";
import { sessionQuery } from "./queries";
import { router } from "./router";
import { readable, theme } from "./theme";
import { loadNotifications } from "./ui/notify";

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
