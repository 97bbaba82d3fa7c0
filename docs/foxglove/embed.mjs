// Puts the scripts beside it into the layout: node docs/foxglove/embed.mjs
import { readFileSync, writeFileSync } from "node:fs";

const layoutFile = new URL("inspection.json", import.meta.url);
const layout = JSON.parse(readFileSync(layoutFile, "utf8"));
for (const [name, script] of Object.entries(layout.userNodes)) {
  script.sourceCode = readFileSync(new URL(`${name}.ts`, import.meta.url), "utf8");
}
writeFileSync(layoutFile, `${JSON.stringify(layout, undefined, 2)}\n`);
