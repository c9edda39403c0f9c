// Whether flows are stable: asked one after another when the sliders rest, those at the flux before those of the
// curve, and shown as answers arrive.
import { ask, Debounced } from "./ask.js";
import * as curve from "./curve.js";
import { standalone } from "./standalone.js";
import { byId, escaped } from "./page.js";
import { chute, grains, state } from "./state.js";

let results = [], count = 0, searching = false;

const asking = new Debounced(400, async (signal) => {
  const query = { ...chute(), ...grains() }, chosen = Math.min(Number(state.flow) || 0, count - 1);
  const result = async (which) => {
    const answer = await ask("stability", { ...query, ...which }, signal);
    signal.throwIfAborted();
    return answer.error ? { state: "unknown", says: `not known whether it is stable: ${answer.error}` } : answer;
  };
  const order = [chosen, ...Array.from({ length: count }, (_, i) => i).filter((i) => i !== chosen)];
  for (const flow of order.filter((i) => i >= 0 && !results[i])) {
    results[flow] = await result({ Q: state.Q, flow });
    show();
  }
  searching = false;
  for (let [next] = curve.notExamined(); next; [next] = curve.notExamined()) {
    const known = await result({ branch: next.branch, point: next.point });
    curve.addStability(next, known);
    // A question that cannot be asked for one flow cannot be asked for any flow of the curve.
    if (known.state === "unknown" && known.reason && !known.searched) break;
  }
});

/** Other flows are wanted: questions about the previous ones are cancelled. */
export function stop() {
  asking.stop();
  searching = false;
  show();
}

/** Other flows are there: `number` of them. */
export function restart(number) {
  results = [];
  count = number;
  searching = count > 0 && !standalone;
  again();
}

/** Go on with what is not known yet. */
export function again() { if (!standalone) asking.begin(); }

/** Put what is known beside the flows. */
export function show() {
  byId("flows").querySelectorAll(".stability").forEach((place, i) => {
    const known = results[i];
    place.innerHTML = known ? `<b>${escaped(known.says)}</b>${known.waves ? ` (${escaped(known.waves)})` : ""}` : searching ? "stability: searching for growing waves…" : "stability not examined";
    place.dataset.state = known?.state ?? "";
  });
}
