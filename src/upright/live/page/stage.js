// The stage: the track, the cart and the pole, in metres, with x to the right and angles from upright
// to the right.
import { colour, line, penOf } from "./paint.js";

/** @typedef {import("./upright.js").State} State */
/** @typedef {import("./paint.js").Pen} Pen */
/**
 * @typedef {object} Scene what is drawn
 * @property {State} state where the cart-pole is
 * @property {State} [measured] what the agent measured, if it is something else
 * @property {State | null} [fallen] where it fell last
 * @property {number} push from -1, surely to the left, to 1, surely to the right
 * @property {number} outside force on the cart that is not the agent's [N]
 * @property {Record<string, number>} parameters of the plant
 */

const CART = { wide: 0.44, high: 0.2 }; // [m]

/**
 * Return how metres become pixels: x and y of a place on the canvas, whose ground is y = 0.
 * @param {{ clientWidth: number, clientHeight: number }} canvas
 * @param {Record<string, number>} parameters
 */
export function viewOf(canvas, parameters) {
  const [wide, high] = [canvas.clientWidth, canvas.clientHeight];
  const length = 2 * parameters.half_length;
  const tall = Math.max(1, length) + CART.high + 0.35;
  const scale = Math.min(wide / (2.3 * parameters.position_limit), (high - 30) / tall);
  const ground = high - 30;
  return {
    scale,
    ground,
    x: (/** @type {number} */ metres) => wide / 2 + scale * metres,
    y: (/** @type {number} */ metres) => ground - scale * metres,
    /** Return both ends of the pole. */
    pole: (/** @type {State} */ { x, theta }) => {
      const [foot, top] = [wide / 2 + scale * x, ground - scale * CART.high];
      return /** @type {[number, number][]} */ ([
        [foot, top],
        [foot + scale * length * Math.sin(theta), top - scale * length * Math.cos(theta)],
      ]);
    },
  };
}

/**
 * Draw a scene.
 * @param {HTMLCanvasElement} canvas
 * @param {Scene} scene
 */
export function drawStage(canvas, scene) {
  const pen = penOf(canvas);
  const view = viewOf(canvas, scene.parameters);
  drawTrack(pen, view, scene.parameters);
  drawWedge(pen, view, scene);
  if (scene.fallen) drawCartPole(pen, view, scene.fallen, "fallen", "fallen");
  drawCartPole(pen, view, scene.state, "cart", "pole");
  if (scene.measured) drawMeasured(pen, view, scene.measured);
  drawPushes(pen, view, scene);
}

/** @typedef {ReturnType<typeof viewOf>} View */

/** @param {Pen} pen @param {View} view @param {Record<string, number>} parameters */
export function drawTrack(pen, view, parameters) {
  const limit = parameters.position_limit;
  line(pen, "track", 2, [view.x(-limit), view.ground], [view.x(limit), view.ground]);
  for (const side of [-limit, limit]) {
    line(pen, "limit", 4, [view.x(side), view.ground + 6], [view.x(side), view.y(0.3)]);
  }
  for (let metre = -Math.floor(limit); metre <= limit; metre += 1) {
    line(pen, "track", 1, [view.x(metre), view.ground], [view.x(metre), view.ground + 6]);
    pen.font = "12px system-ui, sans-serif";
    pen.fillStyle = colour("muted");
    pen.textAlign = "center";
    pen.fillText(`${metre} m`.replace("-", "−"), view.x(metre), view.ground + 21);
  }
}

/** Draw how far the pole may lean. @param {Pen} pen @param {View} view @param {Scene} scene */
function drawWedge(pen, view, { state, parameters }) {
  const [foot] = view.pole(state);
  const radius = view.scale * 2 * parameters.half_length;
  pen.beginPath();
  pen.moveTo(...foot);
  pen.arc(...foot, radius, -Math.PI / 2 - parameters.angle_limit, -Math.PI / 2 + parameters.angle_limit);
  pen.closePath();
  pen.fillStyle = colour("limit-faint");
  pen.fill();
}

/**
 * @param {Pen} pen
 * @param {View} view
 * @param {State} state
 * @param {string} cart colour of the cart
 * @param {string} pole colour of the pole
 */
export function drawCartPole(pen, view, state, cart, pole) {
  const [wide, high] = [view.scale * CART.wide, view.scale * CART.high];
  pen.fillStyle = colour(cart);
  pen.beginPath();
  pen.roundRect(view.x(state.x) - wide / 2, view.ground - high, wide, high, 4);
  pen.fill();
  line(pen, pole, Math.max(4, 0.06 * view.scale), ...view.pole(state));
}

/** Draw what the agent measured, dashed. @param {Pen} pen @param {View} view @param {State} state */
function drawMeasured(pen, view, state) {
  pen.setLineDash([6, 6]);
  line(pen, "measured", 2, ...view.pole(state));
  pen.setLineDash([]);
}

/** Draw the agent's push, and a hand's below it. @param {Pen} pen @param {View} view @param {Scene} scene */
function drawPushes(pen, view, { state, push, outside }) {
  const middle = view.y(CART.high / 2);
  arrow(pen, "force", view.x(state.x), middle, 0.55 * push * view.scale, (CART.wide / 2) * view.scale);
  arrow(pen, "limit", view.x(state.x), middle, 0.03 * outside * view.scale, (CART.wide / 2) * view.scale);
}

/**
 * Draw an arrow to one side, from the side of the cart.
 * @param {Pen} pen
 * @param {string} name of its colour
 * @param {number} x
 * @param {number} y
 * @param {number} length to the right
 * @param {number} gap
 */
function arrow(pen, name, x, y, length, gap) {
  if (Math.abs(length) < 1) return;
  const side = Math.sign(length);
  const [from, to] = [x + side * gap, x + side * gap + length];
  line(pen, name, 3, [from, y], [to, y]);
  line(pen, name, 3, [to - 7 * side, y - 6], [to, y], [to - 7 * side, y + 6]);
}
