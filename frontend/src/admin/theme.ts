import { Alert, Anchor, Badge, createTheme, type CSSVariablesResolver, type MantineColorsTuple } from "@mantine/core";

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

export const theme = createTheme({
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
export const readable: CSSVariablesResolver = () => ({
  variables: {},
  light: { "--mantine-color-dimmed": "#545b62", "--mantine-color-placeholder": "#646b72", "--mantine-color-error": "#c2255c" },
  dark: { "--mantine-color-dimmed": "#a6a7ab", "--mantine-color-placeholder": "#9a9ca1", "--mantine-color-anchor": "#7badb9" },
});
