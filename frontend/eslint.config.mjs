/** Lint rules of the pages: strict and with types. Layout is Prettier's alone. */
import js from "@eslint/js";
import { defineConfig, globalIgnores } from "eslint/config";
import reactHooks from "eslint-plugin-react-hooks";
import tseslint from "typescript-eslint";

/** CONTRIBUTING.md: names say what they hold. `tools/check_names.py` keeps the same ones out of Python. */
const EMPTY_NAMES = ["found", "place", "wanted", "who"];
const BROWSER = ["document", "location", "navigator", "sessionStorage", "setTimeout", "window", "XMLHttpRequest"];

export default defineConfig([
  globalIgnores(["dist", "src/api/schema.d.ts"]),
  js.configs.recommended,
  {
    rules: {
      "id-denylist": ["error", ...EMPTY_NAMES],
      "no-restricted-syntax": [
        "error",
        {
          selector: ":matches(VariableDeclarator, TSEnumMember, PropertyDefinition) > Identifier[name=/(^|_)MOST(_|$)/]",
          message: "Write MAX, not MOST.",
        },
      ],
    },
  },
  {
    files: ["**/*.{ts,tsx}"],
    extends: [tseslint.configs.strictTypeChecked, reactHooks.configs.flat["recommended-latest"]],
    languageOptions: { parserOptions: { projectService: true, tsconfigRootDir: import.meta.dirname } },
    linterOptions: { reportUnusedDisableDirectives: "error" },
    rules: {
      // Numbers are written into sentences, keys and styles all over a page; every other type needs a word.
      "@typescript-eslint/restrict-template-expressions": ["error", { allowNumber: true }],
      // `onClick={() => close()}` and `return fail()` read as what they do.
      "@typescript-eslint/no-confusing-void-expression": [
        "error",
        { ignoreArrowShorthand: true, ignoreVoidOperator: true, ignoreVoidReturningFunctions: true },
      ],
    },
  },
  { files: ["**/*.mjs"], languageOptions: { globals: { process: "readonly", console: "readonly", URL: "readonly" } } },
  {
    // Half of a driver runs in node, half in the page that it drives.
    files: ["tests/**/*.mjs"],
    rules: { "no-undef": "off" },
  },
  {
    // Read by browsers too old for modules: a script that knows only what they know.
    files: ["src/participant/public/*.js"],
    languageOptions: { sourceType: "script", globals: Object.fromEntries(BROWSER.map((name) => [name, "readonly"])) },
    // They know no `catch` without a name.
    rules: { "no-unused-vars": ["error", { caughtErrors: "none" }] },
  },
]);
