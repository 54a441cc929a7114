// Which plan is chosen, and what its rehearsal on the model said.
import { state, changed, update } from "../core/store.js";
import { get, path, post } from "../core/api.js";
import { ended, operates } from "../core/actions.js";

const known = new Map(); // plan and model → {job, run, doc, error}
state.plan = null;

export function choose(id) {
  update({ plan: id });
}

/** The plan that is chosen, else the recommended one. */
export function chosenPlan() {
  return state.plans.find((plan) => plan.id === state.plan)
    ?? state.plans.find((plan) => plan.recommended) ?? state.plans[0];
}

const key = (plan) => `${plan.id} ${state.bench.current_model?.id ?? ""}`;

/** The rehearsal of a plan with the current model, or undefined. */
export const rehearsal = (plan) => known.get(key(plan));

/** A rehearsal that another page, or this one before it was loaded anew, has asked for. */
function earlier(plan) {
  const job = state.jobs.find((one) => one.verb === "rehearse" && one.plan === plan.id && !["failed", "cancelled", "interrupted"].includes(one.phase)
    && one.model === state.bench.current_model?.id);
  return job && { job };
}

/** Play a plan on the model, unless that has been done. */
export async function rehearse(plan, again = false) {
  if (!operates() || (known.has(key(plan)) && !again)) return;
  const entry = { job: null, run: null, doc: null, error: null };
  known.set(key(plan), entry);
  try {
    const { job } = (!again && earlier(plan)) || (await post("/api/experiments/rehearse", { plan: plan.id }));
    entry.job = job.id;
    changed();
    const done = await ended(job);
    entry.run = done.run;
    if (done.run) entry.doc = await get(path("api", "runs", done.run));
    else entry.error = done.error || `It ended: ${done.phase}.`;
  } catch (error) {
    entry.error = error.message;
  }
  changed();
}
