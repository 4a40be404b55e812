// A swarm: the runs of a study at once, as a hundred transparent cart-poles. They are the runs that
// `upright table --runs 100` makes with the same seed.
import { BUDGET, due } from "./clock.js";
import { penOf } from "./paint.js";
import { Run } from "./run.js";
import { drawCartPole, drawTrack, viewOf } from "./stage.js";

const COUNT = 100;
const PIECE = 2000; // steps of one run before the next has its turn
const FAINT = 0.14; // opacity of each

export class Swarm {
  /** @param {Run[]} runs */
  constructor(runs) {
    this.runs = runs;
    this.owed = runs.map(() => 0);
    this.turn = 0;
  }

  /**
   * Return a swarm that knows nothing yet.
   * @param {import("./upright.js").LearnerModule} module
   * @param {import("./upright.js").RunOptions} options
   * @param {number} delay of pushes [steps]
   */
  static async create(module, options, delay) {
    const runs = [];
    for (let run = 0; run < COUNT; run += 1) {
      runs.push(await Run.create(module, { ...options, run }, delay));
    }
    return new Swarm(runs);
  }

  /** Advance all runs by what is due, as far as there is time. @param {number} seconds @param {string} speed */
  advance(seconds, speed) {
    const steps = due(seconds, speed === "auto" ? "10" : speed, this.runs[0].timeStep);
    this.owed = this.owed.map((owed, i) => (this.runs[i].over ? 0 : Math.min(owed + steps, 1e6)));
    const end = performance.now() + BUDGET;
    for (let tried = 0; tried < this.runs.length && performance.now() < end; ) {
      const count = Math.min(Math.floor(this.owed[this.turn]), PIECE);
      if (count) this.runs[this.turn].advance(count, false);
      this.owed[this.turn] -= count;
      tried = count ? 0 : tried + 1;
      this.turn = (this.turn + 1) % this.runs.length;
    }
    if (speed === "max") this.owed.fill(0); // or a slower speed would begin late
  }

  /** How many trials each run has needed until the pole stood; infinite if it does not yet. */
  get needed() {
    return this.runs.map(({ learner, stands }) => {
      if (learner.stage === "succeeded") return learner.trials;
      return stands ? learner.trials + 1 : Infinity;
    });
  }

  /** How many trials any run has had. */
  get most() {
    return Math.max(...this.runs.map(({ learner }) => learner.trials));
  }

  /** @param {HTMLCanvasElement} canvas */
  draw(canvas) {
    const pen = penOf(canvas);
    const { parameters } = this.runs[0];
    const view = viewOf(canvas, parameters);
    drawTrack(pen, view, parameters);
    pen.globalAlpha = FAINT;
    for (const { learner } of this.runs) drawCartPole(pen, view, learner.state, "cart", "pole");
    pen.globalAlpha = 1;
  }
}
