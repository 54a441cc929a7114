// Compare, locate, diagnose, add: where the model fails, what it lacks, and the error as it falls.
import { html, nothing } from "../core/html.js";
import { state, update } from "../core/store.js";
import { cancelJob, modelOf, open, operates, runs } from "../core/actions.js";
import { post } from "../core/api.js";
import { attempt } from "../core/messages.js";
import { clock, duration, words } from "../core/format.js";
import { anyRuns, chosenRecords, diagnose, documentOf, runVerb } from "./diagnosis_steps.js";
import { falling } from "./falling.js";
import { timeline } from "./timeline.js";
import { diagnosisResult, runningCandidates } from "./diagnosis_result.js";
import { compareResult } from "./compare_result.js";
import { locateResult } from "./locate_result.js";
import { calibrateResult, checkResult, nextExperimentResult, plainResult } from "./other_results.js";
import { figures } from "./figures.js";

const VERBS = [
  ["check", "Check", "Does the model file contradict the records? Seconds, nothing is fitted."],
  ["compare", "Compare", "Run the model beside the records: how large is the error, and where."],
  ["locate", "Locate", "Which balance of force or flow is broken, and which subsystem breaks it."],
  ["calibrate", "Calibrate", "Fit the free parameters."],
];
const RESULTS = {
  diagnose: diagnosisResult, add: diagnosisResult, compare: compareResult, locate: locateResult,
  check: checkResult, calibrate: calibrateResult, next_experiment: nextExperimentResult,
};

function tick(record, on) {
  const others = chosenRecords().map((one) => one.id).filter((id) => id !== record.id);
  update({ chosenRecords: on ? [...others, record.id] : others });
}

function recordsMenu(chosen) {
  const text = chosen.length === 1 ? chosen[0].name : chosen.length ? `${chosen.length} records` : "choose records";
  return html`<div class="field-like"><span class="soft small">Records</span>
    <details class="menu"><summary class="button" id="choose-records">${text}</summary><div class="card popup stack tight">
      ${state.records.length ? nothing : html`<span class="soft">There are none.</span>`}
      ${state.records.map((record) => html`<label class="check"><input type="checkbox" ?disabled=${Boolean(record.problem)}
        .checked=${chosen.some((one) => one.id === record.id)} @change=${(event) => tick(record, event.target.checked)}>
        ${record.name} <span class="soft small">${duration(record.duration)}</span></label>`)}</div></details></div>`;
}

function modelMenu() {
  const current = state.bench.current_model;
  const choose = (event) => attempt(() => post("/api/models/current", { model: event.target.value }));
  return html`<label class="field">Model
    <select id="current-model" ?disabled=${!operates()} @change=${choose}>
      ${state.models.filter((model) => !model.problem).map((model) => html`
        <option value=${model.id} ?selected=${model.id === current?.id}>${model.name}</option>`)}</select></label>`;
}

function setup() {
  const chosen = chosenRecords();
  const locked = !operates() || !chosen.length || !state.bench.current_model;
  return html`<section class="card setup" aria-label="What is compared">
    ${recordsMenu(chosen)}${modelMenu()}
    <div class="row verbs">
      ${VERBS.map(([verb, text, title]) => html`<button id=${`verb-${verb}`} title=${title} ?disabled=${locked} @click=${() => runVerb(verb)}>${text}</button>`)}
      <label class="check" title="A part of the records, and nothing that only confirms: sooner, but what is small is missed"><input type="checkbox" id="quick"
        .checked=${state.quick} @change=${(event) => update({ quick: event.target.checked })}>Quick</label>
      <button class="primary" id="verb-diagnose" title="Try every effect of the library, and faults of the data" ?disabled=${locked || anyRuns()}
        @click=${diagnose}>Diagnose</button></div>
  </section>`;
}

/** The job that is shown: the one that was chosen, else the newest of these verbs. */
function shownJob() {
  const fits = state.jobs.filter((job) => RESULTS[job.verb]);
  return fits.find((job) => job.id === state.shownJob) ?? fits[0];
}

function history(shown) {
  const jobs = state.jobs.filter((job) => RESULTS[job.verb]).slice(0, 12).reverse();
  if (jobs.length < 2) return nothing;
  return html`<div class="segmented results" role="group" aria-label="Results">${jobs.map((job) => html`
    <button aria-pressed=${job === shown} title=${`${job.title}, ${clock(job.created)}`} @click=${() => update({ shownJob: job.id })}>
      ${runs(job) ? html`<i class="spinner"></i>` : nothing}${words(job.verb)}</button>`)}</div>`;
}

function running(job) {
  return html`<section class="card" aria-label="Progress"><header><h2>${job.title}</h2>
      <button class="small" id="cancel-job" ?disabled=${!operates()} @click=${() => cancelJob(job)}>${job.verb === "diagnose" && !job.progress?.startsWith("ending") ? "Finish now" : "Cancel"}</button></header>
    <progress aria-label="Running"></progress>
    <p class="row spread progress-text"><span>${job.progress || words(job.phase)}</span><span class="soft">${duration(job.seconds)}</span></p>
    ${falling(job)}
    ${runningCandidates(job)}
  </section>`;
}

function failed(job) {
  return html`<section class="card"><header><h2>${job.title}</h2><span class="chip ${job.phase === "failed" ? "poor" : ""}">${job.phase}</span></header>
    ${job.error ? html`<p class="notice poor">${job.error}</p>` : html`<p class="soft">There is no result.</p>`}
    ${job.command ? html`<details><summary>The same on the command line</summary><code class="command">${job.command}</code></details>` : nothing}</section>`;
}

function result(job) {
  if (!job) return nothing;
  if (runs(job)) return running(job);
  if (!job.run) return failed(job);
  const doc = documentOf(job.run);
  if (!doc) return html`<div class="empty"><i class="spinner"></i></div>`;
  return html`${(RESULTS[job.verb] ?? plainResult)(doc, job)}${figures(job)}`;
}

function nothingYet() {
  return html`<section class="card"><div class="empty">
    ${state.records.length
      ? html`<p>Choose what to ask above. <strong>Diagnose</strong> tries every effect of the library and says which one is missing.</p>`
      : html`<p>There is no record to judge ${modelOf(state.bench.current_model?.id)?.name ?? "the model"} by.</p>
        <p class="row"><button class="primary" @click=${() => open("experiment")}>Run an experiment</button>
          <button @click=${() => open("records")}>Bring a record</button></p>`}
  </div></section>`;
}

export function diagnoseView() {
  const job = shownJob();
  return html`
    <div class="title"><div><h1>Diagnose</h1>
      <p>Compare the model with measurements, see where it fails, learn what it lacks, add that, and watch the error fall.</p></div></div>
    <div class="columns">
      <div class="stack">${setup()}${history(job)}${job ? result(job) : nothingYet()}</div>
      ${timeline()}
    </div>`;
}
