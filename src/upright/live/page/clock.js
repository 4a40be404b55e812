// How many steps of the learner a frame of the screen has. At the speed "auto" it begins in real time,
// hurries once the first falls have been seen, and slows down when the pole stands.

/** @typedef {import("./run.js").Run} Run */

const FIRST = 2; // so many falls are seen in real time
const STANDS = 500; // steps of a trial after which the pole stands
const PAUSE = 0.8; // after a fall in real time [s]
const BUDGET = 12; // how long a frame may compute [ms]
const LONGEST = 0.1; // a frame that took longer counts as this long [s]

export class Clock {
  constructor() {
    this.owed = 0;
    this.rest = 0;
    /** For how long it was watched [s]. */
    this.watched = 0;
  }

  /**
   * Return how many times real time a run is to go now.
   * @param {string} speed
   * @param {Run} run
   */
  factor(speed, run) {
    if (speed === "max") return Infinity;
    if (speed !== "auto") return Number(speed);
    const { trials, steps, stage } = run.learner;
    if (stage === "balancing" && steps > STANDS) return 1;
    return trials < FIRST ? 1 : 10;
  }

  /**
   * Advance a run by what is due since the last frame. Return whether a trial ended.
   * @param {Run} run
   * @param {number} seconds since the last frame
   * @param {string} speed
   */
  advance(run, seconds, speed) {
    const passed = Math.min(seconds, LONGEST);
    this.watched += passed;
    this.rest = Math.max(0, this.rest - passed);
    if (this.rest > 0 || run.over) return false;
    const factor = this.factor(speed, run);
    const trials = run.learner.trials;
    this.owed = factor === Infinity ? 1e9 : Math.min(this.owed, 1e6) + (passed * factor) / run.timeStep;
    const seen = factor <= 10;
    const end = performance.now() + BUDGET;
    while (this.owed >= 1 && performance.now() < end) {
      const made = run.advance(Math.min(Math.floor(this.owed), seen ? 100 : 20_000), seen);
      this.owed = made ? this.owed - made : 0;
      if (seen && run.learner.trials > trials) {
        this.owed = 0;
        this.rest = factor <= 1 ? PAUSE : PAUSE / factor;
        break;
      }
    }
    if (factor === Infinity) this.owed = 0;
    return run.learner.trials > trials;
  }
}
