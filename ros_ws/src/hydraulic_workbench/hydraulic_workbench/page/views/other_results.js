// Results that need no picture of their own.
import { html, nothing } from "../core/html.js";
import { state, update } from "../core/store.js";
import { open } from "../core/actions.js";
import { digits, duration, percent, words } from "../core/format.js";
import { quantity } from "../core/quantities.js";
import { fallingSteps } from "./falling.js";

const TONES = { contradiction: "poor", doubtful: "fair", "not identifiable": "fair", note: "" };
const over = (one) => one?.validation ?? one?.fit ?? one;

export function checkResult(doc) {
  return html`<section class="card" aria-label="Check"><header><h2>The model file against the records</h2></header>
    <p class="verdict ${doc.verdict.level}">${doc.verdict.text}</p>
    <div class="stack tight">${doc.findings.map((one) => html`<p class="notice ${TONES[one.severity] ?? ""}"><span class="chip ${TONES[one.severity] ?? ""}">${one.severity}</span>
      ${one.text} <span class="soft">${one.remedy}</span></p>`)}</div></section>`;
}

export function calibrateResult(doc) {
  const moved = doc.parameters ?? [];
  return html`<section class="card" aria-label="Calibration"><header><h2>Calibration</h2></header>
    <p class="verdict ${doc.verdict.level}">${doc.verdict.text}</p>
    ${fallingSteps([{ value: over(doc.fit?.before), title: "before" }, { value: over(doc.fit?.after), title: "after" }])}
    <div class="scroll"><table><thead><tr><th>Parameter</th><th class="number">Before</th><th class="number">After</th><th class="number">± standard error</th><th></th></tr></thead>
      <tbody>${moved.map((one) => html`<tr><th>${words(one.key).replace(".", ": ")}</th><td class="number">${quantity(one.before, one.unit)}</td><td class="number">${quantity(one.value, one.unit)}</td>
        <td class="number">${one.standard_error === null ? "–" : quantity(one.standard_error, one.unit, 2)}</td>
        <td>${one.identifiable ? nothing : html`<span class="chip fair">not identifiable</span>`}${one.at_bound ? html`<span class="chip poor">at ${one.at_bound} bound</span>` : nothing}</td></tr>`)}</tbody></table></div></section>`;
}

export function nextExperimentResult(doc, job) {
  const toTab = () => { update({ plan: state.plans.find((plan) => plan.run === job.run)?.id ?? null }); open("experiment"); };
  return html`<section class="card" aria-label="Next experiment"><header><h2>The next experiment</h2>
      <button class="primary" id="to-experiment" @click=${toTab}>To the experiment</button></header>
    <p class="verdict ${doc.verdict?.level ?? ""}">${doc.verdict?.text}</p>
    <div class="scroll"><table><thead><tr><th>If this is true</th><th>and this is fitted</th><th class="number">Separation</th><th class="number">Mistaken with</th></tr></thead>
      <tbody>${(doc.pairs ?? []).map((one) => html`<tr><th>${words(one.true)}</th><td>${words(one.refitted)}</td><td class="number">${digits(one.separation, 3)}</td>
        <td class="number">${percent(one.misclassification_probability)}</td></tr>`)}</tbody></table></div>
    <ul class="findings">${(doc.movements ?? []).map((one) => html`<li>from ${duration(one.start)}: ${one.description}</li>`)}</ul></section>`;
}

export function plainResult(doc) {
  return html`<section class="card"><p class="verdict ${doc.verdict?.level ?? ""}">${doc.verdict?.text ?? "Done."}</p></section>`;
}
