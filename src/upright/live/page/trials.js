// The trials: a bar each, on a logarithmic scale, beside what guessing needs and what was published.
import { colour, line, penOf, write } from "./paint.js";

/**
 * @typedef {object} Reference what trials are compared with, in numbers of trials
 * @property {{ low: number, high: number, trials: number[] } | null} guess between which half of its runs
 *   end, and all of them in order
 * @property {{ name: string, trials: number } | null} published
 */

const EDGE = { left: 44, right: 8, top: 10, bottom: 24 };

/**
 * Draw the lengths of all trials.
 * @param {HTMLCanvasElement} canvas
 * @param {number[]} lengths of the trials that have ended, in steps
 * @param {number} present steps of the present trial
 * @param {number} success steps of a success
 * @param {Reference} reference
 */
export function drawTrials(canvas, lengths, present, success, reference) {
  const pen = penOf(canvas);
  const all = present ? [...lengths, present] : lengths;
  const most = Math.max(20, all.length * 1.1, Math.min(60, (reference.published?.trials ?? 0) * 1.1));
  const across = pen.wide - EDGE.left - EDGE.right;
  const up = pen.high - EDGE.top - EDGE.bottom;
  const x = (/** @type {number} */ trial) => EDGE.left + (across * trial) / most;
  const y = (/** @type {number} */ steps) =>
    pen.high - EDGE.bottom - (up * Math.log10(Math.max(steps, 1))) / Math.log10(success);
  const { guess, published } = reference;
  if (guess) {
    pen.fillStyle = colour("guess");
    pen.fillRect(x(guess.low - 1), EDGE.top, x(guess.high) - x(guess.low - 1), up);
  }
  for (let power = 0; 10 ** power <= success; power += 1) {
    const steps = 10 ** power;
    line(pen, "faint", 1, [EDGE.left, y(steps)], [pen.wide - EDGE.right, y(steps)]);
    write(pen, steps >= 1000 ? `${steps / 1000}k` : String(steps), EDGE.left - 6, y(steps) + 4, "right");
  }
  line(pen, "force", 1.5, [EDGE.left, y(success)], [pen.wide - EDGE.right, y(success)]);
  const wide = Math.max(1, x(1) - x(0) - 2);
  all.forEach((steps, i) => {
    pen.fillStyle = colour(i < lengths.length ? "past" : "cart");
    pen.fillRect(x(i) + 1, y(steps), wide, pen.high - EDGE.bottom - y(steps));
  });
  if (published && published.trials > most) {
    write(pen, `published: ${published.trials} →`, pen.wide - EDGE.right - 4, EDGE.top + 18, "right");
  } else if (published) {
    line(pen, "limit", 2, [x(published.trials), EDGE.top], [x(published.trials), pen.high - EDGE.bottom]);
  }
  line(pen, "track", 1, [EDGE.left, pen.high - EDGE.bottom], [pen.wide - EDGE.right, pen.high - EDGE.bottom]);
  for (const trial of ticks(most)) write(pen, String(trial), x(trial - 0.5), pen.high - 7, "center");
}

/** Return numbers of trials to write below the bars. @param {number} most */
function ticks(most) {
  const [unit] = [1, 2, 5, 10, 20, 50, 100, 200, 500].filter((each) => most / each <= 10);
  return Array.from({ length: Math.floor(most / unit) }, (_, i) => unit * (i + 1));
}

/** Return what the picture's parts mean. @param {Reference} reference */
export function explainTrials({ guess, published }) {
  const parts = ["How many steps each trial lasted; 50 steps are a second, the green line is a success."];
  if (guess) {
    parts.push(
      `Grey: half of the runs of pure guessing end between trial ${guess.low} and trial ${guess.high} (100 runs, made here).`,
    );
  }
  if (published) parts.push(`Red: the published mean, ${published.trials} trials (${published.name}).`);
  return parts.join(" ");
}
