// Design an experiment: what kind, how long, how large; the rest follows from the model.
import { html, nothing } from "../core/html.js";
import { state, changed, update } from "../core/store.js";
import { post } from "../core/api.js";
import { ended, operates, runs, jobOf } from "../core/actions.js";
import { attempt, say } from "../core/messages.js";
import { refresh } from "../core/connection.js";
import { digits } from "../core/format.js";

const design = { signal: null, duration: 20, part: 0.8, own: false, low: -1, high: 1, job: null };

async function run() {
  const band = design.own ? [10 ** design.low, 10 ** design.high] : null;
  const before = new Set(state.plans.map((plan) => plan.id));
  const answer = await attempt(() => post("/api/plans/design", { signal: design.signal, duration: design.duration, part: design.part, band }));
  if (!answer) return;
  design.job = answer.job.id;
  changed();
  const job = await ended(answer.job);
  if (job.phase !== "finished") {
    say(job.error || `The design ended: ${job.phase}.`, "poor");
    return;
  }
  await refresh("plans");
  const made = state.plans.find((plan) => !before.has(plan.id));
  if (made) update({ plan: made.id });
}

function range(title, text, key, from, to, step) {
  return html`<label class="field"><span class="row spread"><span>${title}</span><b>${text}</b></span>
    <input type="range" min=${from} max=${to} step=${step} .value=${String(design[key])}
      @input=${(event) => { design[key] = Number(event.target.value); changed(); }}></label>`;
}

export function designForm() {
  const { signals } = state;
  if (!signals?.length) return nothing;
  design.signal ??= signals[0].name;
  const busy = runs(jobOf(design.job));
  return html`<section class="card"><header><h2>Or design one</h2></header>
    <div class="stack tight">
      <label class="field">Signal <select @change=${(event) => { design.signal = event.target.value; changed(); }}>
        ${signals.map((signal) => html`<option value=${signal.name} ?selected=${signal.name === design.signal}>${signal.title}</option>`)}</select></label>
      ${range("Duration", `${design.duration} s`, "duration", 5, 60, 1)}
      ${range("Part of the usable amplitude", `${Math.round(100 * design.part)} %`, "part", 0.1, 1, 0.05)}
      <label class="check small"><input type="checkbox" .checked=${design.own} @change=${(event) => { design.own = event.target.checked; changed(); }}> A band of my own</label>
      ${design.own ? html`
        ${range("From", `${digits(10 ** design.low, 2)} Hz`, "low", -2, 1, 0.05)}
        ${range("To", `${digits(10 ** design.high, 2)} Hz`, "high", -1, 2.5, 0.05)}`
        : html`<p class="soft small">0.1 … 2 times the bandwidth of the current model.</p>`}
      <button id="design" ?disabled=${!operates() || busy || (design.own && design.high <= design.low)} @click=${run}>
        ${busy ? html`<i class="spinner"></i>Designing` : "Design"}</button>
    </div></section>`;
}
