// The state of the page is its address: whoever opens a copied address sees the same.

const listeners = [];
export const material = ["slope", "e", "ew", "roughness", "surface", "closure"];
const defaults = {
  si: "", d: "1", rho: "2500", theme: "", flow: "0", against: "h", whole: "", stability: "1", pin: "", story: "", x: "slope", y: "roughness", shade: "most",
};
// Values of lists and check boxes; the parameters of the chute are checked by the server.
const parameters = ["slope", "e", "ew", "roughness"];
const allowed = {
  si: ["", "1"], whole: ["", "1"], stability: ["", "1"], theme: ["", "light", "dark"], against: ["h", "M", "T_surface"], x: parameters, y: parameters,
  shade: ["most", "families", "density", "interior"],
};
// Milliseconds without a change after which the state is written to the address, unless a button is down.
const rest = 250;
let first = {}, unchanged = [], due = null, held = false, written = "", newest = 0, stepsChanged = () => {};
export const state = {};

/** Take the state of the address, over the defaults and over `preset`, in which the `fixed` names stay. */
export function start(preset, fixed = []) {
  unchanged = fixed;
  first = { ...defaults, ...Object.fromEntries(Object.entries(preset).map(([name, value]) => [name, String(value)])) };
  Object.assign(state, fromAddress());
  written = address();
  newest = place();
}

function fromAddress() {
  const given = new URLSearchParams(location.search), known = (name) => given.has(name) && !unchanged.includes(name) && (allowed[name]?.includes(given.get(name)) ?? true);
  const taken = Object.fromEntries(Object.entries(first).map(([name, value]) => [name, known(name) ? given.get(name) : value]));
  return taken.x === taken.y ? { ...taken, x: defaults.x, y: defaults.y } : taken;
}

/** Change parts of the state, tell the listeners which, and put it into the address. */
export function change(parts) {
  const changed = Object.keys(parts).filter((name) => state[name] !== String(parts[name]));
  if (!changed.length) return;
  for (const name of changed) state[name] = String(parts[name]);
  for (const listen of listeners) listen((...names) => names.some((name) => changed.includes(name)));
  wait();
}

/** A whole drag is one step to undo: the address is written when the pointer rests. */
function wait() {
  clearTimeout(due);
  due = setTimeout(() => { if (held) wait(); else write(); }, rest);
  stepsChanged();
}

addEventListener("pointerdown", () => { held = true; }, true);
for (const end of ["pointerup", "pointercancel"]) addEventListener(end, () => { held = false; }, true);
addEventListener("popstate", () => {
  change(fromAddress());
  clearTimeout(due);
  due = null;
  written = address();
  stepsChanged();
});

/** `listen` is called after each change with a function that tells whether any of some names changed. */
export function onChange(listen) { listeners.push(listen); }

export function address() {
  // What the page opens with need not be what others open with.
  const shown = Object.entries(state).filter(([name, value]) => defaults[name] !== value || first[name] !== value);
  return `${location.pathname}?${new URLSearchParams(shown)}`;
}

/** Put the state into the address, as a step that can be undone. */
export function write() {
  clearTimeout(due);
  due = null;
  if (address() !== written) {
    written = address();
    newest = place() + 1;
    // Browsers allow some hundred steps in half a minute, and none where the page may not know its address.
    try { history.pushState({ place: newest }, "", address()); } catch { /* then there is nothing to undo */ }
  }
  stepsChanged();
}

const place = () => history.state?.place ?? 0;

/** `listen` is called whenever `canUndo` or `canRedo` may have changed. */
export function onSteps(listen) { stepsChanged = listen; }
export const canUndo = () => due !== null || place() > 0;
export const canRedo = () => due === null && place() < newest;

/** Write a pending change as a step now. */
export function settle() { if (due !== null) write(); }

/** Undo the last step. */
export function undo() {
  settle();
  if (canUndo()) history.back();
}

export function redo() { if (canRedo()) history.forward(); }

/** The parameters of the chute, for a question. */
export const chute = () => Object.fromEntries(material.map((name) => [name, state[name]]));

/** The grains, for a question whose answer has words: SI units are wanted where they are given. */
export const grains = () => (state.si ? { diameter: String(Number(state.d) / 1000), density: state.rho } : {});

/** Whether the chute itself changed. */
export const ofChute = (has) => has(...material);

/** Whether panels must be drawn again although no answer changed. */
export const ofLooks = (has) => has("si", "d", "rho", "theme");
