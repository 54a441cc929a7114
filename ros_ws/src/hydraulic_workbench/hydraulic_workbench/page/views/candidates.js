// Candidates of a diagnosis as a table: how probable each is, what it leaves, and Add.
import { html, nothing } from "../core/html.js";
import { state, changed } from "../core/store.js";
import { operates } from "../core/actions.js";
import { digits, percent, words } from "../core/format.js";
import { quantity } from "../core/quantities.js";

const FEW = 8;
const STAGES = { scored: "judged by its score, not refitted yet", refitted: "refitted", added: "explains the error" };
let all = false;
let opened = null;

/** Rows from a document, for a diagnosis whose live rows are gone. */
export function rowsOf(doc) {
  return doc.effects.map((effect) => ({
    name: effect.name, title: words(effect.name), subsystem: effect.subsystem, stage: effect.added ? "added" : effect.refitted ? "refitted" : "scored",
    predicted: null, residual_before: effect.residual_before, residual_after: effect.residual_after, probability: effect.probability ?? null,
  }));
}

function bar(share) {
  if (share === null || share === undefined) return html`<span class="soft">–</span>`;
  return html`<span class="share" title=${percent(share)}><span style=${`width:${Math.max(1, 100 * share)}%`}></span></span><span>${percent(share)}</span>`;
}

function details(row, doc) {
  const effect = doc?.effects.find((one) => one.name === row.name);
  const parameters = effect?.parameters ?? [];
  const instead = Object.entries(doc?.competing_models ?? {}).find(([name]) => name === row.name)?.[1] ?? [];
  return html`<tr class="more"><td colspan="5">
    ${row.summary ? html`<p>${row.summary}</p>` : nothing}
    ${parameters.length ? html`<table><thead><tr><th>Parameter</th><th class="number">Value</th><th class="number">± standard error</th><th class="number">Bounds</th></tr></thead>
      <tbody>${parameters.map((one) => html`<tr><th>${words(one.key.split(".").pop())}</th><td class="number">${quantity(one.value, one.unit)}</td>
        <td class="number">${one.standard_error === null ? "–" : quantity(one.standard_error, one.unit, 2)}</td>
        <td class="number">${one.bounds.map((bound) => quantity(bound, one.unit, 3)).join(" … ")}</td></tr>`)}</tbody></table>`
      : html`<p class="soft">It was judged by its score alone; nothing was fitted.</p>`}
    ${instead.length ? html`<p class="soft">${instead.map((one) => `${words(one.name)} instead leaves ${digits(one.residual_after, 3)} × noise${one.distinguishable ? "" : " (not distinguishable)"}`).join("; ")}.</p>` : nothing}
  </td></tr>`;
}

function row(one, { doc, add, busy }) {
  const has = state.bench.current_model?.effects?.includes(one.name);
  const open = opened === one.name;
  const toggle = () => { opened = open ? null : one.name; changed(); };
  return html`<tr class=${one.stage === "added" ? "chosen" : ""} title=${STAGES[one.stage] ?? one.stage}>
      <th><button class="quiet small expand" aria-expanded=${open} @click=${toggle}>${one.title || words(one.name)}</button></th>
      <td><span class="chip">${words(one.subsystem)}</span></td>
      <td class="share-cell">${bar(one.probability)}</td>
      <td class="number">${Number.isFinite(one.residual_after) ? html`<span class="soft">${digits(one.residual_before, 3)} →</span> <b class=${one.residual_after < 1.1 ? "good" : ""}>${digits(one.residual_after, 3)} ×</b>`
        : one.predicted === null || one.predicted === undefined ? "–" : html`<span class="soft">explains about ${percent(one.predicted)}</span>`}</td>
      <td class="number">${has ? html`<span class="chip good">in the model</span>`
        : html`<button class=${one.stage === "added" ? "primary small" : "small"} aria-label=${`Add ${words(one.name)}`} data-add=${one.name}
            ?disabled=${!add || busy || !operates()} @click=${() => add(one.name)}>Add</button>`}</td>
    </tr>
    ${open ? details(one, doc) : nothing}`;
}

/** `add(name)` joins an effect; null while the search runs. */
export function candidateTable(rows, { doc = null, add = null, busy = false }) {
  if (!rows?.length) return nothing;
  const shown = all ? rows : rows.slice(0, FEW);
  return html`<div class="scroll"><table class="candidates">
      <thead><tr><th>Candidate</th><th>Subsystem</th><th>Probability</th><th class="number">Leaves (× noise)</th><th><span class="visually-hidden">Add</span></th></tr></thead>
      <tbody>${shown.map((one) => row(one, { doc, add, busy }))}</tbody></table></div>
    ${rows.length > FEW ? html`<button class="quiet small" @click=${() => { all = !all; changed(); }}>${all ? "Only the first" : `All ${rows.length} candidates`}</button>` : nothing}`;
}
