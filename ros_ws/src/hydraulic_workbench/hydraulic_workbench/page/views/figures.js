// The figures of a run's report, one at a time, and the report itself.
import { html, nothing } from "../core/html.js";
import { changed } from "../core/store.js";
import { get } from "../core/api.js";
import { attempt } from "../core/messages.js";
import "../charts/plotly_figure.js";

const lists = new Map(); // run → figures
const fetched = new Map(); // run and name → figure
const chosen = new Map(); // run → name
const unfolded = new Set(); // runs whose figures are shown

const base = (run) => `/api/runs/${encodeURIComponent(run)}`;

async function openList(run) {
  if (lists.has(run)) return;
  lists.set(run, null);
  const answer = await attempt(() => get(`${base(run)}/figures`));
  lists.set(run, answer?.figures ?? []);
  changed();
}

function unfold(run, open) {
  if (unfolded.has(run) === open) return;
  if (open) unfolded.add(run);
  else unfolded.delete(run);
  if (open) openList(run);
  changed();
}

function choose(run, name) {
  chosen.set(run, name);
  changed();
}

/** A figure of a run, or the spinner until it is there. */
function figure(run, name) {
  const key = `${run} ${name}`;
  if (!fetched.has(key)) {
    fetched.set(key, null);
    attempt(() => get(`${base(run)}/figures/${encodeURIComponent(name)}`)).then((found) => { fetched.set(key, found || false); changed(); });
  }
  const found = fetched.get(key);
  if (found === false) return html`<p class="soft">It could not be loaded.</p>`;
  return found ? html`<plotly-figure .figure=${found}></plotly-figure>` : html`<i class="spinner"></i>`;
}

/** The first figure of a run's report whose title `fits`. */
export function reportFigure(run, fits) {
  if (!lists.has(run)) queueMicrotask(() => openList(run));
  const list = lists.get(run);
  if (!list) return html`<i class="spinner"></i>`;
  const found = list.find(({ title }) => fits(title));
  return found ? figure(run, found.name) : html`<p class="soft">The report has no such figure.</p>`;
}

export function figures(job) {
  const { run } = job;
  const list = lists.get(run);
  const name = chosen.get(run) ?? list?.[0]?.name;
  return html`<section class="card" aria-label="Report"><header><h2>Report</h2>
      <a class="button" href=${`${base(run)}/report`} target="_blank" rel="noopener">Open the whole report</a></header>
    <details ?open=${unfolded.has(run)} @toggle=${(event) => unfold(run, event.target.open)}><summary>Its figures, to zoom</summary>
      ${unfolded.has(run) && !list ? html`<i class="spinner"></i>` : nothing}
      ${unfolded.has(run) && list?.length ? html`<label class="field">Figure <select @change=${(event) => choose(run, event.target.value)}>
        ${list.map((one) => html`<option value=${one.name} ?selected=${one.name === name}>${[one.title, one.record, one.channel].filter(Boolean).join(" · ")}</option>`)}</select></label>
        ${figure(run, name)}` : nothing}
      ${list && !list.length ? html`<p class="soft">It has none.</p>` : nothing}
    </details>
    ${job.command ? html`<details><summary>The same on the command line</summary><code class="command">${job.command}</code></details>` : nothing}</section>`;
}
