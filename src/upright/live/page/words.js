// What the page says of a run.

/** @typedef {import("./run.js").Run} Run */

/** How each agent learns from a fall, in a sentence. @type {Record<string, (run: Run) => string>} */
const LEARNED = {
  "q-learning": ({ fall }) =>
    fall?.changed
      ? `It went back over its moves, and now pushes the other way in ${counted(fall.changed, "box", "es")} of its table.`
      : "It went back over its moves, and the values in its table sank.",
  "ase-ace": () => "The boxes it passed through were marked down, the last ones most.",
  reinforce: () => "The pushes of its last trials became likelier where they went better than expected, and rarer elsewhere.",
  ndp: () => "Its critic expected better, and both networks were corrected.",
  "adaptive-lqr": () => "It fitted its model of the cart-pole anew, and designed a control for that.",
  "random-search": () => "It learned nothing, and guesses anew.",
};

/** Return what is said below the stage. @param {Run} run */
export function caption(run) {
  const { learner, fall } = run;
  if (learner.stage === "succeeded") return `It balances: ${time(learner.steps * run.timeStep)} without a fall.`;
  if (learner.stage === "failed") return "It has had all of its trials, and has not learned to balance.";
  if (run.stands) {
    return "It stands. Push it: tap the stage left or right of the cart, press ← or →, or drag the cart or the pole.";
  }
  if (!fall) return "It knows nothing yet, and pushes left or right fifty times a second.";
  return `${fallen(run)} ${(LEARNED[learner.layout.agent] ?? (() => ""))(run)}`.trim();
}

/** Return how the last trial ended. @param {Run} run */
export function fallen(run) {
  const { fall, timeStep, parameters } = run;
  if (!fall) return "";
  const { x, theta } = fall.state;
  const how =
    Math.abs(x) > parameters.position_limit
      ? `The cart left the track on the ${x > 0 ? "right" : "left"}`
      : `The pole fell to the ${theta > 0 ? "right" : "left"}`;
  return `${how} after ${time(fall.steps * timeStep)}.`;
}

/** Return a duration. @param {number} seconds */
export function time(seconds) {
  if (seconds < 60) return `${seconds.toFixed(2)} s`;
  const minutes = seconds / 60;
  if (minutes < 60) return `${Math.floor(minutes)} min ${Math.floor(seconds % 60)} s`;
  return `${Math.floor(minutes / 60)} h ${Math.floor(minutes % 60)} min`;
}

function counted(/** @type {number} */ count, /** @type {string} */ noun, /** @type {string} */ plural) {
  return `${count} ${noun}${count === 1 ? "" : plural}`;
}
