// Says as JSON what web/toolpath.js makes of a file: node decode.mjs MODULE FILE [times]
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [module, file, times] = process.argv.slice(2);
const { decodeToolpath } = await import(pathToFileURL(module));
const data = readFileSync(file);
const buffer = data.buffer.slice(data.byteOffset, data.byteOffset + data.byteLength);
if (times) {
  for (let i = 0; i < Number(times); i++) {
    const began = performance.now();
    decodeToolpath(buffer);
    console.log(performance.now() - began);
  }
} else {
  const text = (value) => (Number.isNaN(value) ? "NaN" : value);
  const plain = (key, value) => (ArrayBuffer.isView(value) ? Array.from(value, text) : text(value));
  let answer;
  try {
    answer = decodeToolpath(buffer);
  } catch (error) {
    answer = { error: error.message };
  }
  console.log(JSON.stringify(answer, plain));
}
