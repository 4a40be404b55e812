// The page: a learner balances, falls and learns, drawn as often as the screen shows pictures.
import { load } from "./upright.js";

const form = document.querySelector("form");
const [scene, bars] = document.querySelectorAll("canvas");
const said = document.querySelector("#said");
const agents = await (await fetch("learners.json")).json();
const modules = new Map();
let learner;
let last = 0;
let owed = 0; // steps that are due and not made yet

function fill(select, names) {
  const chosen = select.value;
  select.replaceChildren(...names.map((name) => new Option(name)));
  if (names.includes(chosen)) select.value = chosen;
}

async function begin() {
  const { agent, noise, seed } = form.elements;
  if (!modules.has(agent.value)) modules.set(agent.value, await load(agent.value));
  const module = modules.get(agent.value);
  fill(noise, Object.keys(module.layout.noises));
  learner = await module.create({ noise: noise.value, seed: Number(seed.value) });
}

function frame(now) {
  requestAnimationFrame(frame);
  const seconds = Math.min(now - last, 100) / 1000;
  last = now;
  if (!learner) return;
  owed += (seconds * Number(form.elements.speed.value)) / learner.number("task.parameters.time_step");
  // Some steps learn for long: make them in small pieces, and no longer than a picture takes.
  const end = performance.now() + 12;
  while (owed >= 1 && performance.now() < end) {
    const made = learner.advance(Math.min(Math.floor(owed), 200));
    owed = made ? owed - made : 0;
  }
  owed = Math.min(owed, 1e6);
  drawScene();
  drawBars();
  tell();
}

function drawScene() {
  const { x, theta } = learner.state;
  const limit = learner.number("task.parameters.position_limit");
  const length = 2 * learner.number("task.parameters.half_length");
  const pen = prepared(scene);
  const scale = scene.width / (2.4 * limit);
  const ground = scene.height - 40;
  const cart = scene.width / 2 + scale * x;
  pen.fillRect(0, ground + 18, scene.width, 2);
  for (const side of [-limit, limit]) {
    pen.fillRect(scene.width / 2 + scale * side - 1, ground - 10, 3, 30);
  }
  pen.fillRect(cart - 35, ground - 18, 70, 36);
  pen.beginPath();
  pen.moveTo(cart, ground - 18);
  pen.lineTo(cart + scale * length * Math.sin(theta), ground - 18 - scale * length * Math.cos(theta));
  pen.lineWidth = 9;
  pen.lineCap = "round";
  pen.strokeStyle = "#c2571a";
  pen.stroke();
}

function drawBars() {
  const lengths = learner.lengths;
  const pen = prepared(bars);
  const wide = Math.min(bars.width / Math.max(lengths.length, 1), 24);
  const most = Math.log(learner.number("task.steps"));
  lengths.forEach((length, i) => {
    const high = (bars.height * Math.log(length)) / most;
    pen.fillRect(i * wide, bars.height - high, Math.max(wide - 1, 1), high);
  });
}

function prepared(canvas) {
  const pen = canvas.getContext("2d");
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.fillStyle = getComputedStyle(document.body).color;
  return pen;
}

function tell() {
  const { stage, trials, steps } = learner;
  const trial = stage === "balancing" ? trials + 1 : trials;
  const words = { succeeded: "it balances", failed: "it has not learned to balance" };
  const text = `Trial ${trial}, step ${steps.toLocaleString()}${stage in words ? `: ${words[stage]}` : ""}`;
  if (said.textContent !== text) said.textContent = text;
}

form.addEventListener("submit", (event) => {
  event.preventDefault();
  begin();
});
form.addEventListener("change", ({ target }) => target.name !== "speed" && begin());
fill(form.elements.agent, agents);
await begin();
requestAnimationFrame(frame);
