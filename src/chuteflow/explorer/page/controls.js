// Sliders, number fields and lists.
import { number } from "./chart.js";
import { byId, escaped, showMessage } from "./page.js";
import { state } from "./state.js";
import { factor, unit } from "./units.js";

const steps = 1000;
const controls = {};
const offered = [];
let set = null, choices = {}, latest = null;

/** The place of a slider that is nearest to a value. */
function position({ low, high, logarithmic }, value) {
  const within = Math.min(high, Math.max(low, value));
  return Math.round((logarithmic ? Math.log(within / low) / Math.log(high / low) : (within - low) / (high - low)) * steps);
}
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
  foldWhereSmall();
  byId("controls").addEventListener("submit", (event) => event.preventDefault());
  makeCases(about);
  takeTyped("d", "diameter of the grains", (typed) => (typed > 0 ? { d: typed } : null), "a number above 0");
  takeTyped("rho", "density of the grains", (typed) => (typed > 0 ? { rho: typed } : null), "a number above 0");
  for (const name of ["theme", "against"]) byId(name).addEventListener("change", (event) => set({ [name]: event.target.value }, event));
  for (const name of ["si", "whole", "stability"]) byId(name).addEventListener("change", (event) => set({ [name]: event.target.checked ? "1" : "" }, event));
}

/** Cases to choose from, in groups; the list shows the one whose values the controls have. */
function makeCases({ presets, cases }) {
  const groups = [["Views of the paper", presets], ["Chutes and materials", cases]];
  for (const [label, those] of groups) {
    const group = Object.assign(document.createElement("optgroup"), { label });
    for (const one of those) {
      group.append(new Option(one.title, String(offered.length)));
      offered.push({ words: "", ...one });
    }
    byId("presets").append(group);
  }
  addControl('<p id="case-words"></p>');
  byId("presets").addEventListener("change", (event) => {
    const one = offered[event.target.value];
    if (!one) { showCase(); return; }
    latest = one;
    set({ ...one.state, flow: 0 }, event);
    showCase();
  });
}

/** The case that was chosen last if the state still has its values, or the first of which it has. */
function showCase() {
  const holds = (one) => Object.entries(one.state).every(([name, value]) => state[name] === String(value));
  const found = latest && holds(latest) ? latest : offered.find(holds);
  byId("presets").value = found ? String(offered.indexOf(found)) : "";
  byId("case-words").textContent = found?.words ?? "";
}

/** On a phone the sliders fold away; elsewhere they fit. */
function foldWhereSmall() {
  const small = matchMedia("(max-width: 700px)"), fold = () => { byId("fold").open = !small.matches; };
  small.addEventListener("change", fold);
  fold();
}

function addControl(markup) {
  const box = document.createElement("div");
  box.className = "control";
  box.innerHTML = markup;
  byId("sliders").append(box);
  return box;
}

/**
 * Take a number that is typed into a field: `parts` (number) gives the changes of the state, or null for what cannot
 * be drawn. Then, and where no number is typed, the field shows what holds, and the page says why. Whether there is
 * such a chute is for the server to say.
 */
function takeTyped(id, what, parts, wanted) {
  byId(id).addEventListener("change", (event) => {
    const text = event.target.value, typed = Number(text), taken = text === "" || !Number.isFinite(typed) ? null : parts(typed);
    if (taken) { set(taken, event); showControls(); return; }
    const given = event.target.validity.badInput ? "what was typed is no number" : text === "" ? "nothing was typed" : `${text} was typed`;
    showControls();
    showMessage("typed", `The ${what} must be ${wanted}: ${given}, and ${event.target.value} stays.`);
  });
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
  takeTyped(name, control.label.toLowerCase(), (typed) => ({ [name]: typed / factorOf(name) }), "a number");
  if (name === "slope") takeTyped("angle", "angle", (typed) => (typed > 0 && typed < 90 ? { slope: Math.tan((typed * Math.PI) / 180) } : null), "above 0 and below 90 degrees");
}

function makeChoice(name, { label, options, meaning }) {
  const list = Object.entries(options).map(([value, text]) => `<option value="${escaped(value)}">${escaped(text)}</option>`);
  addControl(`<label for="${name}">${escaped(label)}</label>
    <select id="${name}" aria-describedby="${name}-meaning">${list.join("")}</select><p id="${name}-meaning">${escaped(meaning)}</p>`);
  byId(name).addEventListener("change", (event) => set({ [name]: event.target.value }, event));
}

/** Text of a number for a field, or of nothing where there is none. */
const fieldText = (value) => (Number.isFinite(value) ? String(Number(value.toPrecision(6))) : "");

/** Show the state in every control; what was said of typed text is over. */
export function showControls() {
  showMessage("typed", "");
  for (const [name, control] of Object.entries(controls)) {
    const value = Number(state[name]), shown = value * factorOf(name), field = byId(name), slider = byId(`${name}-slider`);
    const units = name === "Q" ? unit("Q") : "";
    field.value = fieldText(shown);
    slider.value = String(position(control, value));
    slider.setAttribute("aria-valuetext", `${number(shown)} ${units}`.trim());
    field.dataset.shown = field.value;
    byId(`${name}-unit`).textContent = units || "–";
    byId(`${name}-unit`).title = units ? "" : "dimensionless";
  }
  byId("folded").textContent = Object.entries(controls).map(([name, { symbol: letter }]) => `${letter} ${byId(name).value}`).join(", ");
  if (controls.slope) byId("angle").value = fieldText(degrees(Number(state.slope)));
  for (const name of ["d", "rho"]) byId(name).value = fieldText(Number(state[name]));
  for (const name of [...Object.keys(choices), "theme", "against"]) byId(name).value = state[name];
  for (const name of ["si", "whole", "stability"]) byId(name).checked = Boolean(state[name]);
  byId("grains").hidden = !state.si;
  showCase();
}

/** The flux, or NaN where the state has none that can be. */
export function flux() {
  const Q = Number(state.Q);
  return Q >= controls.Q.low && Q <= controls.Q.high ? Q : NaN;
}

/** A flux within the range of its slider. */
export const fluxWithin = (Q) => Math.min(controls.Q.high, Math.max(controls.Q.low, Number(Q.toPrecision(5))));
