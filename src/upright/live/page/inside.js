// Inside the learner: which way it would push, by angle and angular velocity, at the cart's present
// position and velocity; and the numbers that it decides by.
import { colour, line, penOf, write } from "./paint.js";

/** @typedef {import("./upright.js").Learner} Learner */
/** @typedef {import("./upright.js").State} State */
/** @typedef {import("./run.js").Run} Run */

const [COLUMNS, ROWS] = [64, 40];
const [ACROSS, UP] = [9, 5]; // arrows, which tell the push without colours
const [MOST_ANGLE, MOST_RATE] = [0.26, 1.6]; // what the picture shows [rad], [rad/s]
const EDGE = { left: 44, right: 8, top: 8, bottom: 26 };
const scratch = document.createElement("canvas");

/** Draw the pushes of a learner. @param {HTMLCanvasElement} canvas @param {Run} run */
export function drawInside(canvas, run) {
  const pen = penOf(canvas);
  const [wide, high] = [pen.wide - EDGE.left - EDGE.right, pen.high - EDGE.top - EDGE.bottom];
  const x = (/** @type {number} */ theta) => EDGE.left + (wide * (theta / MOST_ANGLE + 1)) / 2;
  const y = (/** @type {number} */ rate) => EDGE.top + (high * (1 - rate / MOST_RATE)) / 2;
  const { learner } = run;
  paintField(learner);
  pen.imageSmoothingEnabled = false;
  pen.drawImage(scratch, EDGE.left, EDGE.top, wide, high);
  drawArrows(pen, learner, x, y);
  for (const side of [-1, 1]) {
    const limit = x(side * run.parameters.angle_limit);
    line(pen, "limit", 2, [limit, EDGE.top], [limit, EDGE.top + high]);
  }
  pen.save();
  pen.beginPath();
  pen.rect(EDGE.left, EDGE.top, wide, high);
  pen.clip();
  line(pen, "paper", 3.5, ...run.path.map(placed));
  line(pen, "ink", 1.5, ...run.path.map(placed));
  const here = placed(learner.state);
  line(pen, "paper", 12, here, here);
  line(pen, "ink", 8, here, here);
  pen.restore();
  for (const degrees of [-12, -6, 0, 6, 12]) {
    write(pen, `${degrees}°`.replace("-", "−"), x((degrees * Math.PI) / 180), pen.high - 8, "center");
  }
  for (const rate of [-1, 0, 1]) write(pen, `${rate}/s`.replace("-", "−"), EDGE.left - 6, y(rate) + 4, "right");

  /** @returns {[number, number]} */
  function placed(/** @type {State} */ { theta, theta_dot }) {
    return [x(theta), y(theta_dot)];
  }
}

/** Colour every place by the probability of a push to the right. @param {Learner} learner */
function paintField(learner) {
  [scratch.width, scratch.height] = [COLUMNS, ROWS];
  const pen = /** @type {CanvasRenderingContext2D} */ (scratch.getContext("2d"));
  const pixels = pen.createImageData(COLUMNS, ROWS);
  const [left, right] = [parts(colour("left")), parts(colour("right"))];
  for (let row = 0; row < ROWS; row += 1) {
    for (let column = 0; column < COLUMNS; column += 1) {
      const p = probabilityAt(learner, (column + 0.5) / COLUMNS, (row + 0.5) / ROWS);
      const place = 4 * (row * COLUMNS + column);
      for (let i = 0; i < 3; i += 1) pixels.data[place + i] = left[i] + p * (right[i] - left[i]);
      pixels.data[place + 3] = 255;
    }
  }
  pen.putImageData(pixels, 0, 0);
}

/**
 * Return the probability at a place of the picture, whose sides are from 0 to 1.
 * @param {Learner} learner
 * @param {number} across
 * @param {number} down
 */
function probabilityAt(learner, across, down) {
  const { x, x_dot } = learner.observation;
  const [theta, theta_dot] = [MOST_ANGLE * (2 * across - 1), MOST_RATE * (1 - 2 * down)];
  return learner.probability({ x, x_dot, theta, theta_dot });
}

/**
 * @param {import("./paint.js").Pen} pen
 * @param {Learner} learner
 * @param {(theta: number) => number} x
 * @param {(rate: number) => number} y
 */
function drawArrows(pen, learner, x, y) {
  for (let i = 0; i < ACROSS; i += 1) {
    for (let j = 0; j < UP; j += 1) {
      const [across, down] = [(i + 0.5) / ACROSS, (j + 0.5) / UP];
      const p = probabilityAt(learner, across, down);
      const [to, at] = [x(MOST_ANGLE * (2 * across - 1)), y(MOST_RATE * (1 - 2 * down))];
      const half = 9 * (2 * p - 1);
      const name = p > 0.5 ? "dark" : "light";
      if (Math.abs(half) < 1) continue;
      const side = Math.sign(half);
      line(pen, name, 1.5, [to - half, at], [to + half, at]);
      line(pen, name, 1.5, [to + half - 4 * side, at - 3], [to + half, at], [to + half - 4 * side, at + 3]);
    }
  }
}

/** Return red, green and blue of "#rrggbb". @param {string} hex */
function parts(hex) {
  return [1, 3, 5].map((start) => parseInt(hex.slice(start, start + 2), 16));
}

// ---- The numbers ---------------------------------------------------------------------------------

/** What each agent's decision rests on, in a line. @type {Record<string, (learner: Learner) => string>} */
const NUMBERS = {
  "q-learning": (learner) => {
    const table = learner.array("agent.table");
    const box = boxOf(learner);
    const entry = (/** @type {number} */ place) =>
      learner.number("agent.mirrored") ? Math.min(place, table.length - 1 - place) : place;
    const [left, right] = [0, 1].map((push) => Number(table[entry(2 * box + push)]));
    return `Here, in box ${box + 1} of ${table.length / 2}: left is worth ${short(left)}, right ${short(right)}; a fall is −1.`;
  },
  "ase-ace": (learner) => {
    const box = boxOf(learner);
    return `Here, in box ${box + 1}: weight ${short(Number(learner.array("agent.weights")[box]))}, predicted ${short(Number(learner.array("agent.predictions")[box]))}.`;
  },
  reinforce: (learner) => `Here it pushes to the right with probability ${learner.probability().toFixed(2)}.`,
  ndp: (learner) =>
    `Its action network says ${short(Number(learner.array("agent.action.output")[0]))}, its critic ${short(Number(learner.array("agent.critic.output")[0]))}.`,
  "adaptive-lqr": (learner) =>
    `By its model, a lean grows by ${growth(learner).toFixed(3)} a step. Gains: ${gains(learner)}.`,
  "random-search": (learner) =>
    `Its guess: push to the right where ${[...learner.array("agent.weights")].map((each, i) => `${short(Number(each))} ${["x", "ẋ", "θ", "θ̇"][i]}`).join(" + ")} > 0.`,
};

/** Return what is written below the picture. @param {Learner} learner */
export function explainInside(learner) {
  const numbers = NUMBERS[learner.layout.agent];
  return `Which way it would push at each angle (across) and angular velocity (up): dark is left, light is right. ${numbers ? numbers(learner) : ""}`;
}

/** Return the number of the box that the last measurement lies in. @param {Learner} learner */
function boxOf(learner) {
  const { x, x_dot, theta, theta_dot } = learner.observation;
  let box = 0;
  [x, x_dot, theta, theta_dot].forEach((value, i) => {
    const parts = learner.number(`agent.boxes.parts.${i}`);
    let below = 0;
    while (below < parts - 1 && value > learner.number(`agent.boxes.edges.${i}.${below}`)) below += 1;
    box = box * parts + below;
  });
  return box;
}

const BLOCK = 5; // a push and four measurements

/** Return the factor by which a measurement grows in a step without pushes, by the model. @param {Learner} learner */
function growth(learner) {
  const model = learner.array("agent.model");
  const columns = model.length / 4;
  let past = Array.from({ length: columns / BLOCK }, () => [0, 0, 1, 1]);
  let factor = 1;
  for (let step = 0; step < 60; step += 1) {
    const next = [0, 1, 2, 3].map((row) =>
      past.reduce(
        (sum, seen, k) => seen.reduce((s, each, i) => s + Number(model[row * columns + BLOCK * k + 1 + i]) * each, sum),
        0,
      ),
    );
    factor = Math.hypot(...next) / Math.hypot(...past[0]);
    past = [next, ...past.slice(0, -1)];
  }
  return factor;
}

/** @param {Learner} learner */
function gains(learner) {
  const found = learner.array("agent.gains");
  return ["x", "ẋ", "θ", "θ̇"].map((name, i) => `${short(-Number(found[1 + i]))} ${name}`).join(", ");
}

function short(/** @type {number} */ value) {
  return String(Number(value.toPrecision(2))).replaceAll("-", "−");
}
