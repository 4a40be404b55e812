// Canvases that are sharp on any screen, in the colours of style.css.

/** @typedef {CanvasRenderingContext2D & { wide: number, high: number }} Pen */

/** @type {Map<string, string>} */
const colours = new Map();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => colours.clear());

/** Return a colour of style.css, which is another one in the dark. */
export function colour(/** @type {string} */ name) {
  if (!colours.has(name)) {
    colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  }
  return /** @type {string} */ (colours.get(name));
}

/**
 * Return the pen of an empty canvas. Its unit is the pixel of style sheets, whatever the screen has.
 * @param {HTMLCanvasElement} canvas
 */
export function penOf(canvas) {
  const ratio = devicePixelRatio || 1;
  const [wide, high] = [canvas.clientWidth, canvas.clientHeight];
  const [columns, rows] = [Math.round(wide * ratio), Math.round(high * ratio)];
  if (canvas.width !== columns || canvas.height !== rows) [canvas.width, canvas.height] = [columns, rows];
  const pen = /** @type {Pen} */ (canvas.getContext("2d"));
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, wide, high);
  return Object.assign(pen, { wide, high });
}

/**
 * Draw a line through some points.
 * @param {Pen} pen
 * @param {string} name of its colour
 * @param {number} width
 * @param {...[number, number]} points
 */
export function line(pen, name, width, ...points) {
  pen.beginPath();
  for (const [x, y] of points) pen.lineTo(x, y);
  pen.strokeStyle = colour(name);
  pen.lineWidth = width;
  pen.lineCap = "round";
  pen.stroke();
}

/**
 * Write a text; `align` is its side that lies at x.
 * @param {Pen} pen
 * @param {string} text
 * @param {number} x
 * @param {number} y
 * @param {CanvasTextAlign} [align]
 */
export function write(pen, text, x, y, align = "left") {
  pen.font = "13px system-ui, sans-serif";
  pen.fillStyle = colour("muted");
  pen.textAlign = align;
  pen.fillText(text, x, y);
}
