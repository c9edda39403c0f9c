// A drawing of the chosen flow: grains follow the volume fraction, the velocity and the granular temperature.
import { byId, colour, download, sizeOf } from "./page.js";

const canvas = byId("chute"), key = byId("chute-key"), pause = byId("pause");
const still = matchMedia("(prefers-reduced-motion: reduce)");
// Smallest and largest number of grains, and of their radii in pixels.
const fewest = 25, most = 1500, smallest = 1.5, largest = 12;
// Milliseconds after a change of the sliders for which grains do not move: redraws come first.
const rest = 200;
let view = null, grains = [], running = !still.matches, last = 0, until = 0;

/** The sliders move: the picture changes with the flow alone. */
export function pauseBriefly() { until = performance.now() + rest; }

/** Value of a field at a height, between its points. */
function at(field, z, height) {
  let low = 0, high = z.length - 1;
  while (high - low > 1) { const middle = (low + high) >> 1; if (z[middle] <= height) low = middle; else high = middle; }
  const w = Math.min(1, Math.max(0, (height - z[low]) / (z[high] - z[low] || 1)));
  return field[low] * (1 - w) + field[high] * w;
}

/** The i-th grain: its fraction of the mass below, and its place along the chute, both evenly spread. */
const placed = (i) => ({ fraction: (0.5 + i * 0.7548776662466927) % 1, x: (0.5 + i * 0.5698402909980532) % 1, dx: 0, dz: 0 });

/** Show a flow, or none, on its slope. */
export function show(flow, slope, ink) {
  const box = sizeOf(canvas), ratio = devicePixelRatio || 1;
  const [width, height] = [box.width, box.height].map((side) => Math.max(1, Math.round(side * ratio)));
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  if (!flow) {
    view = null;
    key.textContent = "There is no flow to draw.";
    paint(0);
    return;
  }
  const { z, nu, T, u } = flow.profile, angle = Math.atan(slope), top = Math.min(2.5 * flow.h, z.at(-1));
  // Height for the chute's fall across the picture, and for the flow above it.
  const fall = Math.min(box.width * slope, 0.5 * box.height), pixel = Math.max(8, box.height - fall - 24) / top;
  const radius = Math.min(largest, Math.max(smallest, pixel / 2)), length = (box.width / Math.cos(angle) + 2 * radius) / pixel + top * slope;
  const mass = [0], inside = z.filter((height) => height <= top * 1.000001);
  for (let i = 1; i < inside.length; i++) mass.push(mass[i - 1] + ((nu[i] + nu[i - 1]) / 2) * (z[i] - z[i - 1]));
  // The number of discs whose area is the volume fraction of the picture, whatever their size.
  const exact = (mass.at(-1) * length * pixel ** 2) / (Math.PI * radius ** 2), count = Math.round(Math.min(most, Math.max(fewest, exact)));
  view = { slope, angle, top, pixel, radius, length, ratio, ink, width: box.width, height: box.height, start: box.height - 10 - fall };
  view.speedScale = (0.25 * length) / Math.max(...u.slice(0, inside.length), 1e-9);
  while (grains.length > count) grains.pop();
  while (grains.length < count) grains.push(placed(grains.length));
  for (const grain of grains) {
    grain.z = at(inside, mass, grain.fraction * mass.at(-1));
    grain.u = at(u, z, grain.z);
    grain.root = Math.sqrt(Math.max(0, at(T, z, grain.z)));
  }
  const size = pixel / 2 < smallest ? "grains drawn larger than they are" : pixel / 2 > largest ? "grains drawn smaller than they are" : "grains to scale";
  const number = count === Math.round(exact) ? "" : count < exact ? ", fewer than in the flow" : ", more than in the flow";
  key.textContent = `A drawing of the computed fields, not a simulation: ${size}${number}. The grains cover the volume fraction, move with the velocity and fluctuate with the granular temperature.`;
  paint(0);
}

const normal = () => Math.sqrt(-2 * Math.log(1 - Math.random())) * Math.cos(2 * Math.PI * Math.random());

/** Move each grain for `dt` seconds, with fluctuations about its place. */
function move(dt) {
  const step = dt * view.speedScale, keep = Math.exp(-4 * dt), spread = Math.min(1.5, 0.15 * view.top), kick = 0.6 * Math.sqrt(step);
  for (const grain of grains) {
    grain.x = (grain.x + (grain.u * step) / view.length) % 1;
    const shaken = (d) => Math.min(spread, Math.max(-spread, keep * d + kick * grain.root * normal()));
    grain.dx = shaken(grain.dx);
    grain.dz = shaken(grain.dz);
  }
}

/** Where grains are drawn, in pixels along the chute and above it. */
function* places() {
  const { length, pixel, radius, top, slope } = view, shift = top * slope;
  for (const grain of grains) yield [(grain.x * length - shift + grain.dx) * pixel - radius, Math.abs(grain.z + grain.dz) * pixel + radius];
}

/** Grains of the base, half sunk. */
function* base() {
  const step = Math.max(2 * view.radius, 4);
  for (let x = 0; x < view.width / Math.cos(view.angle) + step; x += step) yield x;
}

function paint(dt) {
  const pen = canvas.getContext("2d");
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  if (!view) return;
  if (dt) move(dt);
  const { ratio, start, angle, width, radius, ink } = view;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.translate(0, start);
  pen.rotate(angle);
  pen.fillStyle = colour("--quiet");
  for (const x of base()) { pen.beginPath(); pen.arc(x, 0, radius, 0, 7); pen.fill(); }
  pen.fillStyle = colour("--rule");
  pen.fillRect(-width, 0, 4 * width, 4 * width);
  pen.fillStyle = ink;
  for (const [x, y] of places()) { pen.beginPath(); pen.arc(x, -y, radius, 0, 7); pen.fill(); }
}

/** The picture as SVG. */
function asSvg() {
  const { width, height, start, angle, radius, ink } = view, round = (v) => v.toFixed(2);
  const disc = (x, y) => `<circle cx="${round(x)}" cy="${round(y)}" r="${round(radius)}"/>`;
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${round(width)} ${round(height)}" width="${round(width)}" height="${round(height)}">
<title>${key.textContent}</title><rect width="100%" height="100%" fill="${colour("--panel")}"/>
<g transform="translate(0 ${round(start)}) rotate(${round((angle * 180) / Math.PI)})"><g fill="${colour("--quiet")}">${[...base()].map((x) => disc(x, 0)).join("")}</g>
<rect x="${-width}" y="0" width="${4 * width}" height="${4 * width}" fill="${colour("--rule")}"/><g fill="${ink}">${[...places()].map(([x, y]) => disc(x, -y)).join("")}</g></g></svg>\n`;
}

/** The picture as it stands, as a file: "png" or "svg". */
export async function save(kind) {
  if (!view) return;
  const name = `chuteflow-chute.${kind}`;
  if (kind === "svg") { download(name, new Blob([asSvg()], { type: "image/svg+xml" })); return; }
  const copy = document.createElement("canvas"), pen = copy.getContext("2d");
  [copy.width, copy.height] = [canvas.width, canvas.height];
  pen.fillStyle = colour("--panel");
  pen.fillRect(0, 0, copy.width, copy.height);
  pen.drawImage(canvas, 0, 0);
  download(name, await new Promise((made) => { copy.toBlob(made, "image/png"); }));
}

function frame(now) {
  const dt = Math.min(0.05, (now - last) / 1000);
  last = now;
  if (!running) return;
  if (view && !document.hidden && now > until) paint(dt);
  requestAnimationFrame(frame);
}

function run(on) {
  const starts = on && !running;
  running = on;
  pause.textContent = running ? "pause" : "play";
  if (starts) requestAnimationFrame(frame);
}

pause.addEventListener("click", () => run(!running));
// Where the system asks for reduced motion, the picture is still until it is started.
still.addEventListener("change", () => run(!still.matches));
run(running);
if (running) requestAnimationFrame(frame);
