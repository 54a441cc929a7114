// How the model came about: every step with its file, the error before and after, and the way back.
import { html, nothing } from "../core/html.js";
import { state, update } from "../core/store.js";
import { post } from "../core/api.js";
import { attempt, say } from "../core/messages.js";
import { modelOf, open, operates, plantRuns } from "../core/actions.js";
import { clock, digits, shortPath, words } from "../core/format.js";
import { undoIcon } from "../core/icons.js";

const undo = () => attempt(() => post("/api/timeline/undo"));
const go = (step) => attempt(() => post("/api/timeline/go", { index: step.index }));

/** Let a model run beside the plant. */
export async function besidePlant(model) {
  if (await attempt(() => post("/api/live_model", { model }))) {
    if (location.hash.includes("live")) return;
    say("It runs beside the plant: watch the residual.", "good", { text: "Live", run: () => open("live") });
  }
}

function change(step) {
  if (step.what === "added") return html`<strong>+ ${words(step.effect)}</strong>`;
  return html`<strong>${words(step.what)}</strong>`;
}

function error(step) {
  if (!Number.isFinite(step.error_after)) return nothing;
  const tone = step.error_after < 1.1 ? "good" : step.error_after < 2 ? "fair" : "poor";
  return html`<span class="row error">${Number.isFinite(step.error_before) ? html`<span class="soft">${digits(step.error_before, 3)} →</span>` : nothing}
    <span class="chip ${tone}">${digits(step.error_after, 3)} × noise</span></span>`;
}

function openRun(step) {
  const job = state.jobs.find((one) => one.run === step.run);
  if (job) update({ shownJob: job.id });
}

function item(step) {
  return html`<li class=${step.current ? "current" : ""} aria-current=${step.current ? "step" : "false"}>
    <span class="bullet"></span>
    <div class="grow">
      <div class="row spread">${change(step)}<span class="soft small">${clock(step.time)}</span></div>
      ${error(step)}
      <div class="soft small file" title=${step.file}>${modelOf(step.model)?.name ?? ""} <code>${shortPath(step.file)}</code></div>
      <div class="row">
        ${step.current ? html`<span class="chip accent">current</span>` : html`<button class="small quiet" ?disabled=${!operates()} @click=${() => go(step)}>Go back to it</button>`}
        ${step.run ? html`<button class="small quiet" @click=${() => openRun(step)}>Result</button>` : nothing}
        ${step.current && plantRuns() ? html`<button class="small" id="beside" ?disabled=${!operates()} @click=${() => besidePlant(step.model)}>Run beside the plant</button>` : nothing}
      </div>
    </div></li>`;
}

export function timeline() {
  const { steps, can_undo: canUndo } = state.timeline;
  return html`<section class="card" aria-label="History of the model"><header><h2>The model so far</h2>
      <button class="small" id="undo" ?disabled=${!operates() || !canUndo} @click=${undo}>${undoIcon()}Undo</button></header>
    ${steps.length ? html`<ol class="timeline">${[...steps].reverse().map(item)}</ol>` : html`<p class="soft">No model has been chosen.</p>`}
    <p class="soft small">Each step is a model file of its own. Nothing is overwritten.</p></section>`;
}
