// A run that is watched: a learner, what happened in its last trials, and what pushes it from outside.

/** @typedef {import("./upright.js").Learner} Learner */
/** @typedef {import("./upright.js").State} State */
/**
 * @typedef {object} Fall the end of a trial
 * @property {number} trial its number, from 1
 * @property {number} steps how many it lasted
 * @property {State} state where the cart-pole was
 * @property {number} changed in how many boxes the learner now pushes to the other side
 */

const WATCHED = 500; // up to this many steps at a time, each is looked at
const STANDS = 500; // steps of a trial after which the pole stands

export class Run {
  /** @param {Learner} learner */
  constructor(learner) {
    this.learner = learner;
    this.choices = choices(learner);
    /** @type {Fall | null} */
    this.fall = null;
    /** @type {State[]} */
    this.path = [];
    /** Steps of all trials. */
    this.steps = 0;
    /** Force of a hand on the cart [N], and for how many more steps. */
    this.hand = 0;
    this.handSteps = 0;
  }

  /**
   * Return a run that knows nothing yet, made by a module.
   * @param {import("./upright.js").LearnerModule} module
   * @param {import("./upright.js").RunOptions} options
   * @param {number} delay of pushes [steps]
   */
  static async create(module, options, delay) {
    const run = new Run(await module.create(options));
    run.learner.set("task.rig.delay", delay);
    return run;
  }

  get over() {
    return this.learner.stage === "succeeded" || this.learner.stage === "failed";
  }

  /** Whether the pole has stood for a while in this trial. */
  get stands() {
    return this.learner.stage === "balancing" && this.learner.steps > STANDS;
  }

  /** The plant's parameters, in SI units. */
  get parameters() {
    const { layout } = this.learner;
    return Object.fromEntries(
      Object.keys(layout.parameters).map((name) => [name, this.learner.number(`task.parameters.${name}`)]),
    );
  }

  /** How long a step is [s]. */
  get timeStep() {
    return this.learner.number("task.parameters.time_step");
  }

  /**
   * Advance by up to `count` steps, and stop at a fall if asked to. Return how many were made.
   * @param {number} count
   * @param {boolean} stops
   */
  advance(count, stops) {
    if (count > WATCHED && !this.handSteps) return this.#advanceUnseen(count);
    let made = 0;
    while (made < count && this.#step()) {
      made += 1;
      if (stops && this.learner.stage !== "balancing") break;
    }
    return made;
  }

  #advanceUnseen(/** @type {number} */ count) {
    const { learner } = this;
    const trials = learner.trials;
    this.path.length = 0;
    const made = learner.advance(count);
    this.steps += made;
    if (learner.trials > trials) this.#noteEnd();
    return made;
  }

  #step() {
    const { learner } = this;
    this.#applyHand();
    const trials = learner.trials;
    const made = learner.advance(1);
    this.steps += made;
    if (made) this.#notePath();
    if (learner.trials > trials) this.#noteEnd();
    return made;
  }

  #notePath() {
    const { steps, state } = this.learner;
    if (steps === 1) this.path.length = 0;
    this.path.push(state);
    if (this.path.length > 100) this.path.shift();
  }

  #noteEnd() {
    const { learner } = this;
    const before = this.choices;
    this.choices = choices(learner);
    const changed = before.filter((each, i) => each !== this.choices[i]).length;
    this.fall = { trial: learner.trials, steps: learner.steps, state: learner.state, changed };
  }

  #applyHand() {
    this.learner.set("task.rig.wind", this.handSteps > 0 ? this.hand : 0);
    if (this.handSteps > 0) this.handSteps -= 1;
  }

  /**
   * Push the cart with a force [N] for a time [s].
   * @param {number} force
   * @param {number} seconds
   */
  push(force, seconds) {
    this.hand = force;
    this.handSteps = Math.max(1, Math.round(seconds / this.timeStep));
  }

  /** Put the cart-pole elsewhere. @param {Partial<State>} parts */
  put(parts) {
    this.learner.state = { ...this.learner.state, ...parts };
  }
}

/** Return in each box whether a table prefers a push to the right. @param {Learner} learner */
function choices(learner) {
  if (!("agent.table" in learner.layout.places)) return [];
  const table = learner.array("agent.table");
  return Array.from({ length: table.length / 2 }, (_, box) => table[2 * box + 1] > table[2 * box]);
}
