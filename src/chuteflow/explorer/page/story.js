// The three flows of the paper, described in a few steps; each sets the chute and the flux that it is about.
import { byId } from "./page.js";
import { state } from "./state.js";

const chute = { slope: 0.3, e: 0.8, ew: 0.8, roughness: 0.6, surface: "free", closure: "lun" };
const steps = [
  [{ Q: 3, flow: 0 }, "This is the chute of figures 2 and 3 of the paper. Grains run down a slope of tan θ = 0.3, and the mass flux is Q = 3. Three steady flows are found that carry it: the coloured points on the curve, which turns back twice."],
  [{ Q: 3, flow: 0 }, "The hot flow is dilute and deep. Its grains are few and fast, and it has the largest height h and the smallest hold-up M of the three. Its volume fraction falls with height everywhere: the density is monotonic."],
  [{ Q: 3, flow: 1 }, "The second flow lies between the two folds (○). On this part of the curve a larger flux goes with a smaller height of the centre of mass."],
  [{ Q: 3, flow: 2 }, "The cold flow is dense and shallow, and holds the most grains. Its volume fraction is largest some way above the base: the density is inverted. The onset of that is marked ◇ on the curve."],
  [{ Q: 5.2, flow: 0 }, "At Q = 5.2, beyond the fold on the right, the second and the cold flow are gone. They met in the fold. Only the hot flow carries this flux."],
  [{ Q: 2.6, flow: 0 }, "At Q = 2.6, below the fold on the left, it is the other way round: the hot and the second flow are gone, and only the cold one is left. The same chute may carry one flux in different ways, and a small change of the flux may change which."],
];
let set = null;

/** `setter` (parts, event) changes the state. */
export function begin(setter) {
  set = setter;
  byId("story-begin").addEventListener("click", (event) => {
    go(1, event);
    byId("story").focus();
  });
  byId("story-back").addEventListener("click", (event) => go(Number(state.story) - 1, event));
  byId("story-next").addEventListener("click", (event) => go(Number(state.story) + 1, event));
  byId("story-end").addEventListener("click", (event) => {
    set({ story: "" }, event);
    byId("story-begin").focus();
  });
  show();
}

/** Go to a step, counted from 1. */
function go(step, event) {
  if (steps[step - 1]) set({ ...chute, ...steps[step - 1][0], story: step }, event);
}

export function show() {
  const step = Number(state.story), current = steps[step - 1];
  byId("story").hidden = !current;
  if (!current) return;
  byId("story-words").textContent = current[1];
  byId("story-place").textContent = `step ${step} of ${steps.length}`;
  byId("story-back").setAttribute("aria-disabled", String(step === 1));
  byId("story-next").setAttribute("aria-disabled", String(step === steps.length));
}
