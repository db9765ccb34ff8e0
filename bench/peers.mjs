// Two readers that a user could take instead, over the same file: node bench/peers.mjs PACKAGE FILE
// Looked for where node finds packages (NODE_PATH, node_modules); without them the benchmark leaves their rows out.
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import path from "node:path";

const [, , name, file] = process.argv;
const roots = [process.cwd(), ...(process.env.NODE_PATH ?? "").split(path.delimiter).filter(Boolean)];
let found;
for (const root of roots) {
  try {
    found = createRequire(path.join(root, "package.json"))(name);
    break;
  } catch {
    try {
      found = createRequire(path.join(root, name, "package.json"))(".");
      break;
    } catch {
      continue;
    }
  }
}
if (!found) process.exit(3);

const text = readFileSync(file, "utf8");
const lines = text.split("\n").length - 1;
const began = process.cpuUsage();
const Reader = found.default ?? found;
let moves = 0;
if (name === "gcode-toolpath") {
  new Reader({ addLine: () => moves++, addArcCurve: () => moves++ }).loadFromStringSync(text);
} else {
  new Reader({ defaultHandler: () => moves++ }).loadFromStringSync(text);
}
const used = process.cpuUsage(began);
const peak_mb = process.resourceUsage().maxRSS / 1024;
console.log(JSON.stringify({ lines, cpu_s: (used.user + used.system) / 1e6, peak_mb }));
