// How many steps of the learner a frame of the screen has. At the speed "auto" it begins in real time,
// hurries once the first falls have been seen, and slows down when the pole stands.

/** @typedef {import("./run.js").Run} Run */

const FIRST = 2; // this many falls are seen in real time
const PAUSE = 0.8; // after a fall in real time [s]
export const BUDGET = 12; // how long a frame may compute [ms]
const LONGEST = 0.1; // a frame that took longer counts as this long [s]

/**
 * Return how many steps are due after a time.
 * @param {number} seconds
 * @param {string} speed how many times real time, or "max"
 * @param {number} timeStep [s]
 */
export function due(seconds, speed, timeStep) {
  return speed === "max" ? 1e9 : (Math.min(seconds, LONGEST) * Number(speed)) / timeStep;
}

export class Clock {
  constructor() {
    this.owed = 0;
    this.rest = 0;
    /** For how long it was watched [s]. */
    this.watched = 0;
  }

  /**
   * Return how fast a run is to go now.
   * @param {string} speed
   * @param {Run} run
   */
  speedOf(speed, run) {
    if (speed !== "auto") return speed;
    return run.stands || run.learner.trials < FIRST ? "1" : "10";
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
    const now = this.speedOf(speed, run);
    const trials = run.learner.trials;
    this.owed = Math.min(this.owed, 1e6) + due(seconds, now, run.timeStep);
    const seen = Number(now) <= 10;
    const end = performance.now() + BUDGET;
    while (this.owed >= 1 && performance.now() < end) {
      const made = run.advance(Math.min(Math.floor(this.owed), seen ? 100 : 20_000), seen);
      this.owed = made ? this.owed - made : 0;
      if (seen && run.learner.trials > trials) {
        this.owed = 0;
        this.rest = PAUSE / Math.max(1, Number(now));
        break;
      }
    }
    if (now === "max") this.owed = 0; // or a slower speed would begin late
    return run.learner.trials > trials;
  }
}
