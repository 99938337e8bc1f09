// Bundles the page into package data: `npm run build`. `npm run check` compares instead, and writes nothing.
import { readFile, writeFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = new URL(".", import.meta.url);
const data = new URL("../src/closeform/viewer/", here);
const licence = await readFile(new URL("node_modules/three/LICENSE", here), "utf8"); // required in every copy
const bundle = await build({
  absWorkingDir: fileURLToPath(here),
  entryPoints: { viewer: "source/main.js" },
  outdir: "out",
  bundle: true,
  minify: true,
  write: false,
  format: "iife",
  target: ["es2022"],
  charset: "ascii",
  legalComments: "none",
  // Read as text into one file: nothing in the bundle may end its script element early.
  supported: { "inline-script": false, "inline-style": false },
  banner: { js: `/* With three.js:\n${licence.trim()}\n*/` },
});

let stale = false;
for (const file of bundle.outputFiles) {
  const name = file.path.split("/").pop();
  const target = new URL(name, data);
  const left = await readFile(target, "utf8").catch(() => "");
  if (left === file.text) continue;
  stale = true;
  if (!process.argv.includes("--check")) {
    await writeFile(target, file.text);
    console.log(`${name}: ${file.text.length} bytes`);
  } else {
    console.error(`src/closeform/viewer/${name} is not what web/ gives: run "npm ci && npm run build" in web/`);
  }
}
if (!stale) console.log("the page is what its sources give");
if (stale && process.argv.includes("--check")) process.exitCode = 1;
