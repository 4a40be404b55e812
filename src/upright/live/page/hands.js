// Hands on the cart-pole: mouse, finger and keys.
import { viewOf } from "./stage.js";

/** @typedef {import("./run.js").Run} Run */

export const TAP = { force: 12, seconds: 0.1 };
export const GUST = { force: 25, seconds: 0.2 };
const NEAR = 24; // a pole is taken hold of within this distance [pixels]

/**
 * Let a visitor push what is shown, and drag the cart-pole of the present run.
 * @param {HTMLCanvasElement} canvas
 * @param {() => Run} present
 * @param {(force: number, seconds: number) => void} push
 */
export function layHandsOn(canvas, present, push) {
  /** What is held: the cart, the pole or nothing. */
  let held = "";

  canvas.addEventListener("pointerdown", (event) => {
    const run = present();
    const view = viewOf(canvas, run.parameters);
    const [foot, tip] = view.pole(run.learner.state);
    const at = placeOf(event);
    if (distance(at, foot, tip) < NEAR && at[1] < foot[1]) held = "pole";
    else if (Math.abs(at[0] - foot[0]) < 0.3 * view.scale && at[1] >= foot[1] - NEAR) held = "cart";
    else push(Math.sign(foot[0] - at[0]) * TAP.force, TAP.seconds);
    if (held) canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return;
    const run = present();
    const view = viewOf(canvas, run.parameters);
    const [foot] = view.pole(run.learner.state);
    const [x, y] = placeOf(event);
    if (held === "cart") {
      const limit = run.parameters.position_limit;
      const metres = (x - view.x(0)) / view.scale;
      run.put({ x: Math.max(-limit, Math.min(limit, metres)), x_dot: 0 });
    } else {
      const limit = run.parameters.angle_limit;
      const angle = Math.atan2(x - foot[0], foot[1] - y);
      run.put({ theta: Math.max(-limit, Math.min(limit, angle)), theta_dot: 0 });
    }
  });
  for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) {
    canvas.addEventListener(name, () => (held = ""));
  }
  canvas.addEventListener("keydown", (event) => {
    const side = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!side) return;
    event.preventDefault();
    const { force, seconds } = event.shiftKey ? GUST : TAP;
    push(side * force, seconds);
  });
}

/** @param {PointerEvent} event @returns {[number, number]} */
function placeOf({ offsetX, offsetY }) {
  return [offsetX, offsetY];
}

/**
 * Return how far a place is from a line between two others.
 * @param {[number, number]} place
 * @param {[number, number]} one
 * @param {[number, number]} other
 */
function distance([x, y], [x1, y1], [x2, y2]) {
  const [dx, dy] = [x2 - x1, y2 - y1];
  const along = Math.max(0, Math.min(1, ((x - x1) * dx + (y - y1) * dy) / (dx * dx + dy * dy)));
  return Math.hypot(x - x1 - along * dx, y - y1 - along * dy);
}
