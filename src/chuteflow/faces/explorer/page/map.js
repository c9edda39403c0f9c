// The map: which chutes carry flows, over two of the four parameters, with this chute as a cross-hair.
import { Latest } from "./ask.js";
import { draw } from "./chart.js";
import { chute, state } from "./state.js";

const canvas = document.getElementById("map"), over = document.getElementById("map-over"), key = document.getElementById("map-key");
const names = ["slope", "e", "ew", "roughness"], choose = { x: document.getElementById("map-x"), y: document.getElementById("map-y") };
let about = null, set = null, answer = null, view = null, holding = false, due = null;

const asked = new Latest("map", (given) => {
  if (given.error) { key.textContent = given.error; return; }
  answer = given;
  redraw();
});

export function begin(given, setter) {
  about = given; set = setter;
  for (const [axis, select] of Object.entries(choose)) {
    for (const name of names) select.append(new Option(about.controls[name].label, name));
    select.addEventListener("change", (event) => {
      const other = axis === "x" ? "y" : "x", swap = state[other] === event.target.value ? { [other]: state[axis] } : {};
      set({ [axis]: event.target.value, ...swap }, event);
    });
  }
  ask();
}

/** A new map is needed where anything but the cross-hair moved. */
export function changed(names_) {
  const moved = ["e", "ew", "slope", "roughness", "surface", "closure"].some((name) => names_.has(name) && name !== state.x && name !== state.y);
  if (moved || names_.has("x") || names_.has("y")) ask();
  redraw();
}

function ask() {
  for (const axis of ["x", "y"]) choose[axis].value = state[axis];
  clearTimeout(due);
  // A cross-hair that moves asks nothing, so that the map is drawn once for all of its positions.
  due = setTimeout(() => {
    const held = Object.fromEntries(Object.entries(chute()).filter(([name]) => name !== state.x && name !== state.y));
    asked.ask({ ...held, x: state.x, y: state.y });
  }, 150);
}

const shade = (count, dark) => {
  const light = ["#ffffff", "#d6e4f2", "#9cc3e6", "#4f8fc8", "#1c5a96", "#0b3360"], night = ["#14161a", "#1d3a5c", "#2c6199", "#4f92d1", "#93c2ef", "#d9ecff"];
  return (dark ? night : light)[Math.min(count, 5)];
};

export function redraw() {
  if (!answer || answer.x.name !== state.x || answer.y.name !== state.y) return;
  const { x, y, most, boundaries } = answer;
  const axis = ({ name, values }) => ({ low: values[0], high: values.at(-1), label: `${about.controls[name].label.toLowerCase()} ${about.controls[name].symbol}` });
  const ink = getComputedStyle(document.documentElement).getPropertyValue("--curve");
  view = draw(over, { x: axis(x), y: axis(y), lines: boundaries.map((line) => ({ points: line.points, colour: ink, dash: line.dashed ? "5 4" : "" })) });
  const { box, sx, sy } = view, dark = getComputedStyle(document.documentElement).colorScheme === "dark";
  canvas.style.left = `${box.l}px`; canvas.style.top = `${box.t}px`;
  canvas.style.width = `${box.r - box.l}px`; canvas.style.height = `${box.b - box.t}px`;
  canvas.width = x.values.length; canvas.height = y.values.length;
  const pen = canvas.getContext("2d");
  most.forEach((row, j) => row.forEach((count, i) => { pen.fillStyle = shade(count, dark); pen.fillRect(i, y.values.length - 1 - j, 1, 1); }));
  const px = sx(Number(state[x.name])), py = sy(Number(state[y.name]));
  over.insertAdjacentHTML("beforeend", `<path class="hair" d="M${px} ${box.t}V${box.b}M${box.l} ${py}H${box.r}"/><circle cx="${px}" cy="${py}" r="5" class="special"/>`);
  over.setAttribute("aria-label", `Cross-hair at ${x.name} ${state[x.name]}, ${y.name} ${state[y.name]}: move it with the arrow keys`);
  const counts = [...new Set(most.flat())].sort((a, b) => a - b);
  key.innerHTML = `At most this many flows share one flux: ${counts.map((n) => `<span data-count="${n}"></span>${n}`).join("")}. Lines: ${answer.says}`;
  key.querySelectorAll("span").forEach((span) => { span.style.background = shade(Number(span.dataset.count), dark); });
}

function move(event) {
  if (!view) return;
  const box = over.getBoundingClientRect(), inside = (v, { values }) => Number(Math.min(values.at(-1), Math.max(values[0], v)).toPrecision(4));
  set({ [answer.x.name]: inside(view.sx.inverse(event.clientX - box.left), answer.x), [answer.y.name]: inside(view.sy.inverse(event.clientY - box.top), answer.y) }, event);
}

over.addEventListener("pointerdown", (event) => { holding = true; over.setPointerCapture(event.pointerId); move(event); });
over.addEventListener("pointermove", (event) => { if (holding) move(event); });
for (const end of ["pointerup", "pointercancel"]) over.addEventListener(end, () => { holding = false; });
over.addEventListener("keydown", (event) => {
  const turn = { ArrowRight: ["x", 1], ArrowLeft: ["x", -1], ArrowUp: ["y", 1], ArrowDown: ["y", -1] }[event.key];
  if (!turn || !answer) return;
  event.preventDefault();
  const { name, values } = answer[turn[0]], step = (values.at(-1) - values[0]) / 100;
  set({ [name]: Number(Math.min(values.at(-1), Math.max(values[0], Number(state[name]) + turn[1] * step)).toPrecision(4)) }, event);
});
