// What the visitor chose. The address of the page holds it, so that a link shows the same.

/**
 * @typedef {object} Choice
 * @property {string} agent
 * @property {string} noise name of a noise case
 * @property {string} start
 * @property {number} seed
 * @property {string} speed
 * @property {string} view `one` run, or a `swarm`
 * @property {Record<string, number>} body what sliders set: parameters of the plant, and `delay`
 */

/** @type {Choice} */
export const USUAL = { agent: "q-learning", noise: "none", start: "random", seed: 1, speed: "auto", view: "one", body: {} };

/**
 * What sliders set: their names, units, factors of these in SI units, lowest and highest values, and
 * how fine they are.
 * @type {Record<string, { label: string, unit: string, low: number, high: number, step: number, times?: number }>}
 */
export const SLIDERS = {
  half_length: { label: "Length of the pole", unit: "m", low: 0.2, high: 4, step: 0.05, times: 2 },
  pole_mass: { label: "Mass of the pole", unit: "kg", low: 0.02, high: 2, step: 0.02 },
  force: { label: "Force of a push", unit: "N", low: 1, high: 30, step: 0.5 },
  cart_friction: { label: "Friction of the cart", unit: "N", low: 0, high: 2, step: 0.01 },
  delay: { label: "Delay of pushes", unit: "steps", low: 0, high: 10, step: 1 },
};

/**
 * Return the choice that an address holds; what it does not hold, or wrongly, is as usual.
 * @param {string} hash
 * @param {Record<"agent" | "noise" | "start" | "speed" | "view", string[]>} allowed
 */
export function fromAddress(hash, allowed) {
  const given = new URLSearchParams(hash.replace(/^#/, ""));
  /** @type {Choice} */
  const choice = { ...USUAL, body: {} };
  for (const name of /** @type {const} */ (["agent", "noise", "start", "speed", "view"])) {
    const value = given.get(name) ?? "";
    if (allowed[name].includes(value)) choice[name] = value;
  }
  const seed = Number(given.get("seed") ?? USUAL.seed);
  if (Number.isInteger(seed) && seed >= 0 && seed < 2 ** 32) choice.seed = seed;
  for (const [name, { low, high, times = 1 }] of Object.entries(SLIDERS)) {
    const value = given.has(name) ? Number(given.get(name)) : NaN;
    if (value * times >= low && value * times <= high) choice.body[name] = value;
  }
  return choice;
}

/** Return the address of a choice, without what is as usual. @param {Choice} choice */
export function toAddress(choice) {
  const kept = new URLSearchParams();
  for (const name of /** @type {const} */ (["agent", "noise", "start", "seed", "speed", "view"])) {
    if (choice[name] !== USUAL[name]) kept.set(name, String(choice[name]));
  }
  for (const [name, value] of Object.entries(choice.body)) kept.set(name, String(value));
  return `#${kept}`;
}

/** Return the command that makes the same run, but for what a hand does. @param {Choice} choice */
export function commandOf({ agent, noise, start, seed, view, body }) {
  const words = view === "one" ? ["upright learn", agent] : ["upright table --runs 100 --agents", agent];
  if (view === "swarm") words.push("--noises", noise);
  else if (noise !== "none") words.push("--noise", noise);
  if (start !== "random") words.push("--start", start);
  words.push("--seed", String(seed));
  for (const [name, value] of Object.entries(body)) {
    words.push(name === "delay" ? `--condition delay=${value}` : `--parameter ${name}=${value}`);
  }
  return words.join(" ");
}
