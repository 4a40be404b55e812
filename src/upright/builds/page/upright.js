/**
 * Upright's learners in the browser and in Node.js: the package's own compiled code, to the last bit.
 *
 *     import { load } from "./upright.js";
 *     const learner = await (await load("q-learning")).create({ seed: 7 });
 *     learner.advance(1000);                  // steps of the run that `--seed 7` makes
 *     learner.state.theta;                    // where the pole is [rad]
 *     learner.array("agent.table");           // the table itself, not a copy
 *
 * Units are SI, angles in radians. Nothing here is learned or simulated in JavaScript: it writes
 * numbers into the memory of a module and reads them there.
 */

const STAGES = ["between", "balancing", "succeeded", "failed"];
const COMPONENTS = ["x", "x_dot", "theta", "theta_dot"];
const LARGEST_COUNT = 2 ** 31 - 1;
const ARRAYS = {
  bool: Uint8Array,
  int64: BigInt64Array,
  uint64: BigUint64Array,
  uint32: Uint32Array,
  int32: Int32Array,
  uint8: Uint8Array,
  float64: Float64Array,
  float32: Float32Array,
};

/** Load the module of an agent, from the folder of this file or another. */
export async function load(name, folder = new URL(".", import.meta.url)) {
  const [layout, code] = await Promise.all(
    [`${name}.json`, `${name}.wasm`].map((file) => read(new URL(file, folder))),
  );
  const text = new TextDecoder().decode(layout);
  return new LearnerModule(JSON.parse(text), await WebAssembly.compile(code));
}

async function read(url) {
  if (url.protocol === "file:") {
    const { readFile } = await import("node:fs/promises");
    return readFile(url);
  }
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`${url} cannot be read: ${answer.status} ${answer.statusText}`);
  return answer.arrayBuffer();
}

/** The module of an agent, which makes any number of learners. */
export class LearnerModule {
  constructor(layout, module) {
    this.layout = layout;
    this.module = module;
  }

  /** Return a learner that knows nothing yet, in memory of its own. */
  async create(options = {}) {
    const pages = this.layout.pages;
    const memory = new WebAssembly.Memory({ initial: pages, maximum: pages });
    const { exports } = await WebAssembly.instantiate(this.module, { env: { memory } });
    return new Learner(this.layout, exports, memory, options);
  }
}

/** A learner and its cart-pole. */
export class Learner {
  #exports;
  #memory;
  #base;

  constructor(layout, exports, memory, options) {
    this.layout = layout;
    this.#exports = exports;
    this.#memory = memory;
    this.#base = exports.__heap_base.value;
    this.begin(options);
  }

  /** Forget everything and begin a run. What the options leave out is as the module was built. */
  begin({ seed = 0, run = 0, noise, start, parameters, settings, steps, trials, ...others } = {}) {
    const [unknown] = Object.keys(others);
    if (unknown !== undefined) {
      refuse("option", unknown, "seed run noise start parameters settings steps trials".split(" "));
    }
    requireWhole("seed", seed, 0, 2 ** 32 - 1);
    requireWhole("run", run, 0, 2 ** 32 - 1);
    this.#exports.begin(this.#base);
    if (noise !== undefined) this.setNoise(noise);
    if (start !== undefined) this.#setStart(start);
    if (parameters !== undefined) this.setParameters(parameters);
    if (settings !== undefined) this.setSettings(settings);
    if (steps !== undefined) this.set("task.steps", requireWhole("steps", steps, 1, 10 ** 9));
    const most = this.layout.places.lengths.shape[0];
    if (trials !== undefined) this.set("task.trials", requireWhole("trials", trials, 1, most));
    this.#exports.seed(this.#base, seed, run);
  }

  /** Advance by up to `count` steps, and return how many were made: fewer once the run is over. */
  advance(count) {
    requireWhole("count", count, 0, LARGEST_COUNT);
    return this.#exports.advance(this.#base, count);
  }

  /** Make the rest of the run, and return its outcome. */
  run() {
    while (this.advance(LARGEST_COUNT) > 0);
    return { success: this.stage === "succeeded", lengths: this.lengths };
  }

  /** The probability of a push to the right, by default at the last measurement. */
  probability(observation = this.observation) {
    if (!this.#exports.push_probability) throw new Error("this agent tells no probability");
    const numbers = COMPONENTS.map((name) => requireNumber(name, observation[name]));
    return this.#exports.push_probability(this.#base, ...numbers);
  }

  /** "between" two trials, "balancing", or once the run is over "succeeded" or "failed". */
  get stage() {
    return STAGES[this.number("progress.stage")];
  }

  /** How many trials have ended. */
  get trials() {
    return this.number("progress.trials");
  }

  /** Steps of the present trial; between trials, of the last one. */
  get steps() {
    return this.number("progress.steps");
  }

  /** Steps of every trial that has ended. */
  get lengths() {
    return Array.from(this.array("lengths").subarray(0, this.trials), Number);
  }

  /** The last push: true to the right. */
  get action() {
    return this.number("progress.action") !== 0;
  }

  /** The true state. */
  get state() {
    return fields(this.array("plant.memory"));
  }

  /** Move the cart or the pole. */
  set state(state) {
    const memory = this.array("plant.memory");
    COMPONENTS.forEach((name, i) => (memory[i] = requireNumber(name, state[name])));
  }

  /** What the agent measured last. */
  get observation() {
    return fields(this.array("progress.observation"));
  }

  /** Set the noise: the name of a case, or some of its sizes. */
  setNoise(noise) {
    const sizes = typeof noise === "string" ? entry("noise", noise, this.layout.noises) : noise;
    this.#setEach("noise", sizes, (name) => [`task.noise.${name}`]);
  }

  /** Set parameters of the plant. */
  setParameters(parameters) {
    const present = this.layout.places["task.rig.present"] && this.array("task.rig.present");
    const names = Object.keys(this.layout.parameters);
    for (const [name, value] of Object.entries(parameters)) {
      const { low, high } = entry("parameter", name, this.layout.parameters);
      requireNumber(name, value, low, high);
      if (present) present[names.indexOf(name)] = value;
    }
    this.#setEach("parameter", parameters, (name) =>
      ["plant", "task"].map((owner) => `${owner}.parameters.${name}`),
    );
  }

  /** Change settings of the agent that are numbers in its memory. */
  setSettings(settings) {
    for (const [name, value] of Object.entries(settings)) {
      this.set(entry("setting", name, this.layout.settings), value);
    }
  }

  /** A number in memory, by the name of its place. */
  number(name) {
    const { type, offset } = entry("place", name, this.layout.places);
    return Number(new ARRAYS[type](this.#memory.buffer, this.#base + offset, 1)[0]);
  }

  /** Set a number in memory, by the name of its place. */
  set(name, value) {
    const { type, offset } = entry("place", name, this.layout.places);
    const number = new ARRAYS[type](this.#memory.buffer, this.#base + offset, 1);
    number[0] = number instanceof BigInt64Array ? BigInt(value) : requireNumber(name, Number(value));
  }

  /** An array in memory, by the name of its place: the numbers themselves, row after row. */
  array(name) {
    const { type, shape, offset } = entry("place", name, this.layout.places);
    const size = shape.reduce((product, length) => product * length, 1);
    return new ARRAYS[type](this.#memory.buffer, this.#base + offset, size);
  }

  #setStart(name) {
    this.#setEach("start", entry("start", name, this.layout.starts), (each) => [`task.start.${each}`]);
  }

  #setEach(kind, values, placesOf) {
    for (const [name, value] of Object.entries(values)) {
      const places = placesOf(name).filter((place) => place in this.layout.places);
      if (!places.length) refuse(kind, name, Object.keys(this.layout.places));
      for (const place of places) this.set(place, value);
    }
  }
}

function fields(numbers) {
  return Object.fromEntries(COMPONENTS.map((name, i) => [name, numbers[i]]));
}

function entry(kind, name, table) {
  if (!Object.hasOwn(table, name)) refuse(kind, name, Object.keys(table));
  return table[name];
}

function refuse(kind, name, allowed) {
  throw new RangeError(`${kind} is ${JSON.stringify(name)}; it must be one of ${allowed.join(", ")}`);
}

function requireNumber(name, value, low = -Infinity, high = Infinity) {
  if (typeof value !== "number" || !(value >= low && value <= high)) {
    throw new RangeError(`${name} is ${value}; it must be a number from ${low} to ${high}`);
  }
  return value;
}

function requireWhole(name, value, low, high) {
  if (!Number.isInteger(requireNumber(name, value, low, high))) {
    throw new RangeError(`${name} is ${value}; it must be a whole number`);
  }
  return value;
}
