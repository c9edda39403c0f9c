// Sliders, number fields and lists: what one sets.
import { number } from "./chart.js";
import { byId, escaped } from "./page.js";
import { state } from "./state.js";
import { factor, unit } from "./units.js";

const steps = 1000;
const controls = {};
let set = null, choices = {};

const position = ({ low, high, logarithmic }, value) =>
  (logarithmic ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low)) * steps;
const valueAt = ({ low, high, logarithmic }, place) =>
  logarithmic ? low * (high / low) ** (place / steps) : low + ((high - low) * place) / steps;
const symbol = (text) => escaped(text).replace(/_(.)/, "<sub>$1</sub>");
const degrees = (slope) => (Math.atan(slope) * 180) / Math.PI;
const factorOf = (name) => (name === "Q" ? factor("Q") : 1);

/** Build the form from what the server says about itself; `setter` (parts, event) changes the state. */
export function makeControls(about, setter) {
  set = setter;
  for (const [name, control] of Object.entries(about.controls)) makeSlider(name, control);
  choices = about.choices;
  for (const [name, choice] of Object.entries(choices)) makeChoice(name, choice);
  byId("controls").addEventListener("submit", (event) => event.preventDefault());
  about.presets.forEach((preset, i) => byId("presets").append(new Option(preset.title, i)));
  byId("presets").addEventListener("change", (event) => {
    if (event.target.value !== "") set({ ...about.presets[event.target.value].state, flow: 0 }, event);
    event.target.value = "";
  });
  for (const name of ["d", "rho"]) byId(name).addEventListener("change", (event) => {
    if (Number(event.target.value) > 0) set({ [name]: event.target.value }, event); else showControls();
  });
  for (const name of ["theme", "against"]) byId(name).addEventListener("change", (event) => set({ [name]: event.target.value }, event));
  for (const name of ["si", "whole"]) byId(name).addEventListener("change", (event) => set({ [name]: event.target.checked ? "1" : "" }, event));
}

function addControl(markup) {
  const box = document.createElement("div");
  box.className = "control";
  box.innerHTML = markup;
  byId("controls").append(box);
  return box;
}

function makeSlider(name, control) {
  const angle = `<div class="line"><label for="angle">or angle <i>θ</i></label>
    <input type="number" id="angle" step="any" aria-describedby="${name}-meaning"><span class="unit">°</span></div>`;
  addControl(`<div class="line"><label for="${name}">${escaped(control.label)} <i>${symbol(control.symbol)}</i></label>
    <input type="number" id="${name}" step="any" required aria-describedby="${name}-meaning"><span class="unit" id="${name}-unit"></span></div>
    <input type="range" id="${name}-slider" min="0" max="${steps}" step="1" aria-label="${escaped(control.label)}" aria-describedby="${name}-meaning">
    ${name === "slope" ? angle : ""}<p id="${name}-meaning">${escaped(control.meaning)}</p>`);
  controls[name] = control;
  byId(`${name}-slider`).addEventListener("input", (event) =>
    set({ [name]: Number(valueAt(control, Number(event.target.value)).toPrecision(4)) }, event));
  byId(name).addEventListener("change", (event) => {
    const typed = Number(event.target.value) / factorOf(name);
    if (event.target.value !== "" && Number.isFinite(typed)) set({ [name]: typed }, event); else showControls();
  });
  if (name === "slope") byId("angle").addEventListener("change", (event) => {
    const slope = Math.tan((Number(event.target.value) * Math.PI) / 180);
    if (event.target.value !== "" && Number.isFinite(slope)) set({ slope }, event); else showControls();
  });
}

function makeChoice(name, { label, options, meaning }) {
  const list = Object.entries(options).map(([value, text]) => `<option value="${escaped(value)}">${escaped(text)}</option>`);
  addControl(`<label for="${name}">${escaped(label)}</label>
    <select id="${name}" aria-describedby="${name}-meaning">${list.join("")}</select><p id="${name}-meaning">${escaped(meaning)}</p>`);
  byId(name).addEventListener("change", (event) => set({ [name]: event.target.value }, event));
}

/** Show the state in every control. */
export function showControls() {
  for (const [name, control] of Object.entries(controls)) {
    const value = Number(state[name]), shown = value * factorOf(name), field = byId(name), slider = byId(`${name}-slider`);
    const units = name === "Q" ? unit("Q") : "";
    field.value = String(Number(shown.toPrecision(6)));
    slider.value = String(position(control, value));
    slider.setAttribute("aria-valuetext", `${number(shown)} ${units}`.trim());
    byId(`${name}-unit`).textContent = units || "–";
    byId(`${name}-unit`).title = units ? "" : "dimensionless";
  }
  byId("angle").value = String(Number(degrees(Number(state.slope)).toPrecision(6)));
  for (const name of [...Object.keys(choices), "d", "rho", "theme", "against"]) byId(name).value = state[name];
  for (const name of ["si", "whole"]) byId(name).checked = Boolean(state[name]);
  byId("grains").hidden = !state.si;
}

/** A flux within the range of its slider. */
export const fluxWithin = (Q) => Math.min(controls.Q.high, Math.max(controls.Q.low, Number(Q.toPrecision(5))));
