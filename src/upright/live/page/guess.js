// What pure guessing needs on the same task: a hundred runs of random search, made a few at a time.

const RUNS = 100;

/**
 * After each run, yield how many trials the runs took so far, in order, and the quartiles.
 * @param {import("./upright.js").LearnerModule} module
 * @param {import("./upright.js").RunOptions} task
 * @param {number} delay of pushes [steps]
 */
export async function* guesses(module, task, delay) {
  const learner = await module.create(task);
  /** @type {number[]} */
  const trials = [];
  for (let run = 0; run < RUNS; run += 1) {
    learner.begin({ ...task, run });
    learner.set("task.rig.delay", delay);
    trials.push(learner.run().lengths.length);
    trials.sort((one, other) => one - other);
    const part = (/** @type {number} */ p) => trials[Math.round(p * (trials.length - 1))];
    yield { low: part(0.25), high: part(0.75), trials: [...trials] };
  }
}
