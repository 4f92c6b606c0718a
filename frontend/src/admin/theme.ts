import { createTheme, type MantineColorsTuple } from "@mantine/core";

// A calm petrol, dark enough for white text at every shade that buttons use.
const petrol: MantineColorsTuple = [
  "#e9f4f6", "#d5e5e8", "#aacad1", "#7badb9", "#5595a4", "#3c8697", "#2b7184", "#1f6172", "#125464", "#014855",
];

export const theme = createTheme({
  primaryColor: "petrol",
  primaryShade: { light: 7, dark: 5 },
  autoContrast: true,
  luminanceThreshold: 0.35,
  colors: { petrol },
  fontFamily: "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif",
  defaultRadius: "sm",
  respectReducedMotion: true,
});
