// What a diagnosis, or the adding of one effect, came to.
import { html, nothing } from "../core/html.js";
import { state, changed } from "../core/store.js";
import { get } from "../core/api.js";
import { operates } from "../core/actions.js";
import { percent, words } from "../core/format.js";
import { quantity } from "../core/quantities.js";
import { addEffect, anyRuns, applyVerdict, nextExperiment } from "./diagnosis_steps.js";
import { candidateTable, rowsOf } from "./candidates.js";
import { fallingSteps } from "./falling.js";
import { beforeAfter } from "./before_after.js";

const asked = new Set();

/** Candidates as they were found: of the event, of the job, or of the document. */
function rows(job, doc) {
  const live = state.candidates[job.id];
  if (live) return doc ? judged(live, doc) : live;
  if (!asked.has(job.id)) {
    asked.add(job.id);
    get(`/api/jobs/${encodeURIComponent(job.id)}`).then((answer) => {
      if (answer.candidates?.length) state.candidates = { ...state.candidates, [job.id]: answer.candidates };
      changed();
    }, () => {});
  }
  return doc ? rowsOf(doc) : [];
}

/** Rows of the search with what the verdict's refits, which go to the end, came to. */
function judged(live, doc) {
  const final = new Map(rowsOf(doc).map((one, place) => [one.name, { ...one, place }]));
  const merged = live.map((row) => {
    const end = final.get(row.name);
    return end && end.stage !== "scored" ? { ...row, stage: end.stage, residual_before: end.residual_before, residual_after: end.residual_after } : row;
  });
  const rank = (row) => final.get(row.name)?.place ?? Infinity;
  return merged.sort((a, b) => rank(a) - rank(b));
}

export function runningCandidates(job) {
  if (job.verb !== "diagnose") return nothing;
  const found = state.candidates[job.id] ?? [];
  return found.length ? candidateTable(found, {}) : html`<p class="soft small">Candidates appear here as the search scores them.</p>`;
}

function residualSteps({ residual, verdict }) {
  const over = (one) => one.validation ?? one.fit;
  const after = residual.after_each_effect?.length
    ? residual.after_each_effect.map((one) => ({ value: over(one), title: `+ ${words(one.name)}` }))
    : [{ value: over(residual.after), title: verdict.kind === "data sheet" ? "numbers corrected" : "after" }];
  return [{ value: over(residual.before), title: "before" }, ...after];
}

function dataSheet({ data_sheet: numbers = [] }) {
  if (!numbers.length) return nothing;
  return html`<h3>Numbers of the model file that the records contradict</h3>
    <div class="scroll"><table><thead><tr><th>Number</th><th class="number">The file says</th><th class="number">The records say</th></tr></thead>
    <tbody>${numbers.map((one) => html`<tr><th>${words(one.key)}</th><td class="number">${quantity(one.nominal, one.unit)}</td>
      <td class="number">${quantity(one.value, one.unit)}${one.standard_error ? ` ± ${quantity(one.standard_error, one.unit, 2)}` : ""}</td></tr>`)}</tbody></table></div>`;
}

function recording({ recording: all = {} }) {
  const found = all.faults ?? [];
  const spikes = (all.spikes ?? []).filter((one) => one.count);
  if (!found.length && !spikes.length) return nothing;
  return html`<h3>Faults of the recording</h3>${found.map((one) => html`<p class="notice fair"><strong>${one.text}</strong> ${one.remedy}</p>`)}
    ${spikes.map((one) => html`<p class="notice fair">${words(one.channel)}: ${one.count} spikes, ${percent(one.share)} of its samples.</p>`)}`;
}

function findings({ check = [] }) {
  const worth = check.filter((one) => ["contradiction", "doubtful"].includes(one.severity));
  if (!worth.length) return nothing;
  return html`<h3>Before anything was fitted</h3>${worth.map((one) => html`<p class="notice ${one.severity === "contradiction" ? "poor" : "fair"}">${one.text} <span class="soft">${one.remedy}</span></p>`)}`;
}

const TONES = { explained: "good", close: "fair", off: "poor" };

export function diagnosisResult(doc, job) {
  const added = job.verb === "add";
  const stale = job.model !== state.bench.current_model?.id;
  const canApply = !added && !stale && ["missing", "data sheet", "complete"].includes(doc.verdict.kind);
  return html`
    <section class="card" aria-label="Verdict"><header><h2>${added ? job.title : "Verdict"}</h2><span class="chip ${TONES[doc.verdict.level] ?? ""}">${doc.verdict.kind}</span></header>
      <p class="verdict ${doc.verdict.level}">${doc.verdict.text}</p>
      ${fallingSteps(residualSteps(doc))}
      ${added ? nothing : html`<div class="row" style="margin-top:12px">
        ${canApply ? html`<button id="apply" ?disabled=${!operates() || anyRuns()} @click=${() => applyVerdict(job.run)}>Take the model of the verdict</button>` : nothing}
        <button id="next-experiment" ?disabled=${!operates() || anyRuns() || doc.model_files.length < 2}
          title=${doc.model_files.length < 2 ? "These records leave one model: there is nothing to tell apart" : "Design the experiment that tells the candidates apart"} @click=${() => nextExperiment(job)}>Next experiment</button>
        ${stale ? html`<span class="soft small">The model has changed since.</span>` : nothing}</div>`}
      ${dataSheet(doc)}${recording(doc)}${findings(doc)}
    </section>
    ${added ? nothing : html`<section class="card flush" aria-label="Candidates"><header><h2>Candidates</h2><span class="soft small">a row opens on a click</span></header>
      ${candidateTable(rows(job, doc), { doc, add: (name) => addEffect(job, name), busy: anyRuns() })}</section>`}
    ${beforeAfter(doc, job.run)}`;
}
