/** Addresses of the admin site; pages load when they are first opened. */
import { createRootRoute, createRoute, createRouter, lazyRouteComponent, Outlet } from "@tanstack/react-router";
import { Shell } from "./shell/Shell";
import { ErrorAlert, NotFound } from "./ui/Answer";

const root = createRootRoute({ component: Outlet, notFoundComponent: NotFound });

const signIn = createRoute({
  getParentRoute: () => root,
  path: "/sign-in",
  component: lazyRouteComponent(() => import("./account/SignInPage"), "SignInPage"),
});
const invitation = createRoute({
  getParentRoute: () => root,
  path: "/invitation",
  component: lazyRouteComponent(() => import("./account/InvitationPage"), "InvitationPage"),
});
const start = createRoute({
  getParentRoute: () => root,
  path: "/start",
  component: lazyRouteComponent(() => import("./account/StartPage"), "StartPage"),
});
const letter = createRoute({
  getParentRoute: () => root,
  path: "/letter/$about",
  component: lazyRouteComponent(() => import("./account/LetterPage"), "LetterPage"),
});

const inside = createRoute({ getParentRoute: () => root, id: "inside", component: Shell });
const page = { getParentRoute: () => inside };
const studies = createRoute({ ...page, path: "/", component: lazyRouteComponent(() => import("./studies/StudiesPage"), "StudiesPage") });
const list = createRoute({
  ...page,
  path: "/studies",
  component: lazyRouteComponent(() => import("./studies/StudiesPage"), "StudiesPage"),
});
const create = createRoute({
  ...page,
  path: "/studies/new",
  component: lazyRouteComponent(() => import("./studies/CreatePage"), "CreatePage"),
});
const account = createRoute({
  ...page,
  path: "/account",
  component: lazyRouteComponent(() => import("./account/AccountPage"), "AccountPage"),
});
const people = createRoute({ ...page, path: "/people", component: lazyRouteComponent(() => import("./people/PeoplePage"), "PeoplePage") });
const workspaces = createRoute({
  ...page,
  path: "/workspaces",
  component: lazyRouteComponent(() => import("./people/WorkspacesPage"), "WorkspacesPage"),
});
const audit = createRoute({ ...page, path: "/audit", component: lazyRouteComponent(() => import("./people/AuditPage"), "AuditPage") });
const backups = createRoute({
  ...page,
  path: "/backups",
  component: lazyRouteComponent(() => import("./people/BackupsPage"), "BackupsPage"),
});
const figures = createRoute({
  ...page,
  path: "/blinks",
  component: lazyRouteComponent(() => import("./figures/FiguresPage"), "FiguresPage"),
});

const analyze = createRoute({
  ...page,
  path: "/analyze",
  component: lazyRouteComponent(() => import("./results/AnalyzePage"), "AnalyzePage"),
});
const labelling = createRoute({
  ...page,
  path: "/labelling",
  component: lazyRouteComponent(() => import("./labelling/LabellingPage"), "LabellingPage"),
});
const blinkReview = createRoute({
  ...page,
  path: "/blink-review",
  component: lazyRouteComponent(() => import("./labelling/BlinkReviewPage"), "BlinkReviewPage"),
});

const study = createRoute({
  ...page,
  path: "/studies/$study",
  component: lazyRouteComponent(() => import("./studies/StudyLayout"), "StudyLayout"),
});
const tab = { getParentRoute: () => study };
const tabs = [
  createRoute({ ...tab, path: "/", component: lazyRouteComponent(() => import("./studies/DesignTab"), "DesignTab") }),
  createRoute({ ...tab, path: "/build", component: lazyRouteComponent(() => import("./builder/BuilderTab"), "BuilderTab") }),
  createRoute({ ...tab, path: "/clips", component: lazyRouteComponent(() => import("./studies/ClipsTab"), "ClipsTab") }),
  createRoute({ ...tab, path: "/links", component: lazyRouteComponent(() => import("./studies/LinksTab"), "LinksTab") }),
  createRoute({ ...tab, path: "/rehearsal", component: lazyRouteComponent(() => import("./rehearsal/RehearsalTab"), "RehearsalTab") }),
  createRoute({ ...tab, path: "/monitor", component: lazyRouteComponent(() => import("./monitor/MonitorTab"), "MonitorTab") }),
  createRoute({ ...tab, path: "/results", component: lazyRouteComponent(() => import("./results/ResultsTab"), "ResultsTab") }),
  createRoute({ ...tab, path: "/data", component: lazyRouteComponent(() => import("./data/DataTab"), "DataTab") }),
  createRoute({
    ...tab,
    path: "/participants",
    component: lazyRouteComponent(() => import("./participants/ParticipantsTab"), "ParticipantsTab"),
  }),
  createRoute({
    ...tab,
    path: "/participants/$run",
    component: lazyRouteComponent(() => import("./participants/TimelinePage"), "TimelinePage"),
  }),
  createRoute({
    ...tab,
    path: "/participants/$run/replay",
    component: lazyRouteComponent(() => import("./replay/ReplayPage"), "ReplayPage"),
  }),
  createRoute({ ...tab, path: "/settings", component: lazyRouteComponent(() => import("./studies/SettingsTab"), "SettingsTab") }),
];

const tree = root.addChildren([
  signIn,
  invitation,
  start,
  letter,
  inside.addChildren([
    studies,
    list,
    create,
    account,
    people,
    workspaces,
    backups,
    audit,
    figures,
    analyze,
    labelling,
    blinkReview,
    study.addChildren(tabs),
  ]),
]);

export const router = createRouter({
  routeTree: tree,
  basepath: "/admin",
  defaultPreload: "intent",
  defaultErrorComponent: ({ error }) => (
    <ErrorAlert error={error instanceof Error ? error : new Error(String(error))} retry={() => window.location.reload()} />
  ),
});

declare module "@tanstack/react-router" {
  interface Register {
    router: typeof router;
  }
}
