// Makes a run with a learner's module, and prints its result and its memory as JSON.
// node learner.mjs FOLDER SEED RUN NUMBERS, with learner.wasm and places.json in the folder.
import fs from "node:fs";

const [folder, seed, run, numbers] = process.argv.slice(2);
const { size, places } = JSON.parse(fs.readFileSync(`${folder}/places.json`));
const memory = new WebAssembly.Memory({ initial: 2 + Math.ceil(size / 65536) });
const module = new WebAssembly.Module(fs.readFileSync(`${folder}/learner.wasm`));
const imported = WebAssembly.Module.imports(module).map((each) => each.name);
const { exports } = new WebAssembly.Instance(module, { env: { memory } });
const learner = exports.__heap_base.value;
exports.begin(learner);
for (const [name, value] of Object.entries(JSON.parse(numbers))) {
  const [offset, dtype] = places[name];
  const view = new DataView(memory.buffer, learner + offset);
  if (dtype === "|b1") view.setUint8(0, value);
  else view.setFloat64(0, value, true);
}
exports.seed(learner, Number(seed), Number(run));
while (exports.advance(learner, 2 ** 31 - 1) > 0);
const bytes = Buffer.from(memory.buffer, learner, size).toString("base64");
console.log(JSON.stringify({ imported, bytes }));
