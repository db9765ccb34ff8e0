// Says as JSON what web/toolpath.js makes of a file: node decode.mjs MODULE FILE [options as JSON] [times]
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [module, file, text = "{}", times] = process.argv.slice(2);
const options = JSON.parse(text);
const { decodeToolpath } = await import(pathToFileURL(module));
const data = readFileSync(file);
const buffer = data.buffer.slice(data.byteOffset, data.byteOffset + data.byteLength);
if (times) {
  for (let i = 0; i < Number(times); i++) {
    const began = performance.now();
    decodeToolpath(buffer, options);
    console.log(performance.now() - began);
  }
} else {
  const named = (value) => (Number.isNaN(value) ? "NaN" : value);
  const plain = (key, value) => (ArrayBuffer.isView(value) ? Array.from(value, named) : named(value));
  let answer;
  try {
    answer = decodeToolpath(buffer, options);
    if (options.onlyCount) answer = { corners: answer.lines.length, chordMm: answer.chordMm };
  } catch (error) {
    answer = { error: error.message };
  }
  console.log(JSON.stringify(answer, plain));
}
