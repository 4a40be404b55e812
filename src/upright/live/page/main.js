// The page: a learner is made as the address says, advanced in each frame, and shown.
import { load } from "./upright.js";
import { commandOf, fromAddress, SLIDERS, toAddress, USUAL } from "./choice.js";
import { Clock } from "./clock.js";
import { drawCurves, explainCurves } from "./curves.js";
import { guesses } from "./guess.js";
import { GUST, layHandsOn, TAP } from "./hands.js";
import { drawInside, explainInside } from "./inside.js";
import { Run } from "./run.js";
import { drawStage } from "./stage.js";
import { Swarm } from "./swarm.js";
import { drawTrials, explainTrials } from "./trials.js";
import { caption, fallen, time } from "./words.js";

/** @typedef {import("./upright.js").LearnerModule} LearnerModule */

const GUESS = "random-search";
const INSIDE_EVERY = 4; // frames: this picture is drawn less often

/**
 * @typedef {object} Known
 * @property {string[]} agents
 * @property {string[]} noises
 * @property {string[]} starts
 * @property {Record<string, Record<string, { name: string, trials: number }>>} published by agent, and by
 *   noise with start
 */
/** @type {Known} */
const known = await (await fetch("page.json")).json();
/** @type {Map<string, LearnerModule>} */
const modules = new Map();
let playing = true;
/** The run that is shown; of a swarm, its first. @type {Run} */
let run;
/** @type {Swarm | null} */
let swarm = null;
let clock = new Clock();
/** @type {import("./trials.js").Reference} */
let reference = { guess: null, published: null };
let frames = 0;
let last = 0;

/** @template {HTMLElement} T @param {string} id @returns {T} */
const byId = (id) => /** @type {T} */ (document.getElementById(id));
const [stage, trials, inside] = /** @type {HTMLCanvasElement[]} */ (["stage", "trials", "inside"].map(byId));
const form = /** @type {HTMLFormElement} */ (byId("choice"));
const [speed, view] = /** @type {HTMLSelectElement[]} */ (["speed", "view"].map(byId));
const allowed = {
  agent: known.agents,
  noise: known.noises,
  start: known.starts,
  speed: [...speed.options].map(({ value }) => value),
  view: [...view.options].map(({ value }) => value),
};
let choice = fromAddress(location.hash, allowed);

// ---- A run ---------------------------------------------------------------------------------------

/** Begin a run as it is chosen. */
async function begin() {
  const { agent, noise, start, seed, body } = choice;
  const module = await moduleOf(agent);
  const options = { noise, start, seed, parameters: parametersOf(body) };
  const delay = body.delay ?? 0;
  swarm = choice.view === "swarm" ? await Swarm.create(module, options, delay) : null;
  run = swarm ? swarm.runs[0] : await Run.create(module, options, delay);
  clock = new Clock();
  reference = { guess: null, published: known.published[agent]?.[`${noise} ${start}`] ?? null };
  if (Object.keys(body).length) reference.published = null;
  guess(run, options, delay);
  show();
}

/** Return the module of an agent, loaded once. @param {string} agent */
async function moduleOf(agent) {
  const found = modules.get(agent) ?? (await load(agent));
  modules.set(agent, found);
  return found;
}

/** Return what sliders say of the plant's parameters. @param {Record<string, number>} body */
function parametersOf({ delay: _, ...parameters }) {
  return parameters;
}

/**
 * Find what guessing needs on the same task, as long as the run is the present one.
 * @param {Run} of
 * @param {import("./upright.js").RunOptions} task
 * @param {number} delay of pushes [steps]
 */
async function guess(of, task, delay) {
  for await (const found of guesses(await moduleOf(GUESS), task, delay)) {
    if (run !== of) return;
    reference.guess = found;
    await new Promise((resolve) => setTimeout(resolve, 20));
  }
}

// ---- Frames --------------------------------------------------------------------------------------

function frame(/** @type {number} */ now) {
  requestAnimationFrame(frame);
  const seconds = (now - last) / 1000;
  last = now;
  if (playing && swarm) swarm.advance(seconds, choice.speed);
  else if (playing && clock.advance(run, seconds, choice.speed)) tellFall();
  if (swarm) showSwarm(swarm);
  else showRun();
  if (frames % INSIDE_EVERY === 0) {
    drawInside(inside, run);
    say("inside-note", explainInside(run.learner));
  }
  frames += 1;
  say("play", playing ? "Pause" : "Play");
  if (byId("numbers").closest("details")?.open) fillTables();
}

function showRun() {
  const { learner, timeStep } = run;
  drawStage(stage, {
    state: learner.state,
    measured: isNoisy() ? learner.observation : undefined,
    fallen: run.fall && learner.stage !== "between" ? run.fall.state : null,
    push: learner.stage === "balancing" ? 2 * learner.probability() - 1 : 0,
    outside: learner.number("task.rig.wind"),
    parameters: run.parameters,
  });
  const present = learner.stage === "balancing" ? learner.steps : 0;
  drawTrials(trials, learner.lengths, present, learner.number("task.steps"), reference);
  say("caption", caption(run));
  say("trial", `${learner.trials + (learner.stage === "balancing" ? 1 : 0)}`);
  say("balanced", time(learner.steps * timeStep));
  say("simulated", time(run.steps * timeStep));
  say("watched", time(clock.watched));
  say("trials-note", explainTrials(reference));
}

/** @param {Swarm} shown */
function showSwarm(shown) {
  shown.draw(stage);
  const { needed, most } = shown;
  const guessed = reference.guess?.trials ?? [];
  drawCurves(trials, needed, most, guessed);
  const standing = needed.filter(Number.isFinite).length;
  say("caption", `${standing} of ${needed.length} stand. Each has its own random numbers, and learns for itself.`);
  say("trial", `up to ${most}`);
  say("balanced", "–");
  say("simulated", time(shown.runs.reduce((sum, { steps }) => sum + steps, 0) * run.timeStep));
  say("watched", "–");
  say("trials-note", explainCurves(needed, guessed));
}

/** Whether what the agent measures is not the truth. */
function isNoisy() {
  return ["angle", "others", "angle_offset"].some((name) => run.learner.number(`task.noise.${name}`) > 0);
}

/** Write a text, if it is another one. @param {string} id @param {string} text */
function say(id, text) {
  const place = byId(id);
  if (place.textContent !== text) place.textContent = text;
}

/** Tell screen readers of the end of a trial. */
function tellFall() {
  say("live", run.over ? caption(run) : `Trial ${run.learner.trials}: ${fallen(run)}`);
}

function fillTables() {
  const { state, observation, lengths } = run.learner;
  const degrees = (/** @type {number} */ angle) => ((angle * 180) / Math.PI).toFixed(2);
  fill("numbers", [
    ["", "true", "measured"],
    ["Position [m]", state.x.toFixed(3), observation.x.toFixed(3)],
    ["Velocity [m/s]", state.x_dot.toFixed(3), observation.x_dot.toFixed(3)],
    ["Angle [°]", degrees(state.theta), degrees(observation.theta)],
    ["Angular velocity [°/s]", degrees(state.theta_dot), degrees(observation.theta_dot)],
  ]);
  const from = Math.max(0, lengths.length - 10);
  fill("lengths", lengths.slice(from).map((steps, i) => [`Trial ${from + i + 1}`, steps.toLocaleString("en")]));
}

/** Fill a table with rows, whose first cells are heads. @param {string} id @param {string[][]} rows */
function fill(id, rows) {
  const body = /** @type {HTMLTableElement} */ (byId(id)).tBodies[0];
  const wanted = rows.map(([head, ...cells]) => {
    const row = document.createElement("tr");
    const first = document.createElement("th");
    first.scope = "row";
    first.textContent = head;
    row.append(first, ...cells.map((cell) => Object.assign(document.createElement("td"), { textContent: cell })));
    return row;
  });
  body.replaceChildren(...wanted);
}

// ---- Controls ------------------------------------------------------------------------------------

/** Show the choice in the form and in the address. */
function show() {
  const { layout } = run.learner;
  for (const name of /** @type {const} */ (["agent", "noise", "start"])) {
    fillSelect(name, allowed[name], choice[name]);
  }
  field("seed").value = String(choice.seed);
  [speed.value, view.value] = [choice.speed, choice.view];
  for (const [name, { times = 1, unit }] of Object.entries(SLIDERS)) {
    const usual = name === "delay" ? 0 : layout.parameters[name].value;
    const value = (choice.body[name] ?? usual) * times;
    field(name).value = String(value);
    say(`${name}-value`, `${Number(value.toPrecision(3))} ${unit}`);
  }
  history.replaceState(null, "", toAddress(choice) === "#" ? location.pathname : toAddress(choice));
  say("command", commandOf(choice));
}

/** @param {string} name @returns {HTMLInputElement} */
function field(name) {
  return /** @type {HTMLInputElement} */ (form.elements.namedItem(name));
}

/** @param {string} name @param {string[]} options @param {string} chosen */
function fillSelect(name, options, chosen) {
  const select = /** @type {HTMLSelectElement} */ (form.elements.namedItem(name));
  if (!select.options.length) select.replaceChildren(...options.map((each) => new Option(each)));
  select.value = chosen;
}

function makeSliders() {
  for (const [name, { label, low, high, step }] of Object.entries(SLIDERS)) {
    const input = Object.assign(document.createElement("input"), { type: "range", name, step, min: low, max: high });
    const place = document.createElement("label");
    const value = Object.assign(document.createElement("output"), { id: `${name}-value` });
    place.append(label, value, input);
    byId("sliders").append(place);
  }
}

/** Change what may change while the pole balances. @param {string} name @param {string} value */
function change(name, value) {
  if (name === "noise") {
    choice.noise = value;
    each(({ learner }) => learner.setNoise(value));
  } else {
    const number = Number(value) / (SLIDERS[name].times ?? 1);
    choice.body[name] = number;
    each(({ learner }) => {
      if (name === "delay") learner.set("task.rig.delay", number);
      else learner.setParameters({ [name]: number });
    });
  }
  show();
}

/** Do something with every run that is shown. @param {(shown: Run) => void} work */
function each(work) {
  (swarm?.runs ?? [run]).forEach(work);
}

function toggle() {
  playing = !playing;
}

function step() {
  playing = false;
  each((shown) => shown.advance(1, true));
  if (!swarm && run.learner.stage !== "balancing") tellFall();
}

function again() {
  choice.seed = (choice.seed + 1) % 2 ** 32;
  playing = true;
  begin();
}

function listen() {
  layHandsOn(stage, () => run, push);
  byId("play").addEventListener("click", toggle);
  byId("step").addEventListener("click", step);
  byId("again").addEventListener("click", again);
  byId("left").addEventListener("click", () => push(-TAP.force, TAP.seconds));
  byId("right").addEventListener("click", () => push(TAP.force, TAP.seconds));
  byId("gust").addEventListener("click", gust);
  byId("usual").addEventListener("click", () => {
    choice = { ...USUAL, agent: choice.agent, body: {} };
    begin();
  });
  speed.addEventListener("change", () => {
    choice.speed = speed.value;
    show();
  });
  view.addEventListener("change", () => {
    choice.view = view.value;
    begin();
  });
  form.addEventListener("input", ({ target }) => {
    const { name, value } = /** @type {HTMLInputElement} */ (target);
    if (name in SLIDERS) change(name, value);
  });
  form.addEventListener("change", ({ target }) => {
    const { name, value } = /** @type {HTMLInputElement} */ (target);
    if (name === "noise") change(name, value);
    if (!["agent", "start", "seed"].includes(name)) return;
    choice = fromAddress(toAddress({ ...choice, [name]: name === "seed" ? Number(value) : value }), allowed);
    begin();
  });
  form.addEventListener("submit", (event) => event.preventDefault());
  addEventListener("hashchange", () => {
    choice = fromAddress(location.hash, allowed);
    begin();
  });
  addEventListener("keydown", (event) => {
    const typing = event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement;
    const pressing = event.target instanceof HTMLButtonElement && event.key === " ";
    if (typing || pressing || event.ctrlKey || event.metaKey || event.altKey) return;
    const action = { " ": toggle, ".": step, n: again, g: gust }[event.key];
    if (action) event.preventDefault();
    action?.();
  });
}

/** Push every cart with a force [N] for a time [s]. @param {number} force @param {number} seconds */
function push(force, seconds) {
  each((shown) => shown.push(force, seconds));
}

function gust() {
  push((Math.random() < 0.5 ? -1 : 1) * GUST.force, GUST.seconds);
}

makeSliders();
await begin();
listen();
requestAnimationFrame(frame);
