// The share of runs whose pole did not stand after each number of trials, beside that of guessing.
import { line, penOf, write } from "./paint.js";

const EDGE = { left: 44, right: 8, top: 10, bottom: 24 };
const LEAST = 20; // trials that the picture shows at least

/**
 * Draw both curves.
 * @param {HTMLCanvasElement} canvas
 * @param {number[]} needed trials that each run needed; infinite if it still falls
 * @param {number} most trials that any run has had
 * @param {number[]} guessed trials that runs of guessing needed
 */
export function drawCurves(canvas, needed, most, guessed) {
  const pen = penOf(canvas);
  const shown = Math.max(LEAST, most, guessed[Math.floor(0.95 * guessed.length)] ?? 0);
  const x = (/** @type {number} */ trials) => EDGE.left + ((pen.wide - EDGE.left - EDGE.right) * trials) / shown;
  const y = (/** @type {number} */ share) => pen.high - EDGE.bottom - (pen.high - EDGE.top - EDGE.bottom) * share;
  for (const share of [0, 0.25, 0.5, 0.75, 1]) {
    line(pen, "faint", 1, [EDGE.left, y(share)], [pen.wide - EDGE.right, y(share)]);
    write(pen, `${100 * share} %`, EDGE.left - 6, y(share) + 4, "right");
  }
  const unit = shown > 100 ? 50 : shown > 40 ? 10 : 5;
  for (let trial = unit; trial <= shown; trial += unit) write(pen, String(trial), x(trial), pen.high - 7, "center");
  if (guessed.length) {
    pen.setLineDash([5, 5]);
    line(pen, "muted", 2, ...steps(guessed, shown));
    pen.setLineDash([]);
  }
  line(pen, "cart", 2.5, ...steps(needed, Math.min(most, shown)));

  /** @param {number[]} trials @param {number} last @returns {[number, number][]} */
  function steps(trials, last) {
    /** @type {[number, number][]} */
    const points = [[x(0), y(1)]];
    for (let trial = 1; trial <= last; trial += 1) {
      points.push([x(trial), y(share(trials, trial - 1))], [x(trial), y(share(trials, trial))]);
    }
    return points;
  }
}

/** Return the share of runs that need more trials than this. @param {number[]} needed @param {number} trials */
function share(needed, trials) {
  return needed.filter((each) => each > trials).length / needed.length;
}

/**
 * Return what the picture shows, in words.
 * @param {number[]} needed
 * @param {number[]} guessed
 */
export function explainCurves(needed, guessed) {
  const standing = needed.filter(Number.isFinite).length;
  const parts = [`Blue: the share of ${needed.length} runs whose pole did not stand after each number of trials; it stands in ${standing} now.`];
  if (guessed.length) parts.push(`Dashed: ${guessed.length} runs of pure guessing, each until it succeeded.`);
  return parts.join(" ");
}
