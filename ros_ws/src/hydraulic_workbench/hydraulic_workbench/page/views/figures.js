// The figures of a run's report, one at a time, and the report itself.
import { html, nothing } from "../core/html.js";
import { changed } from "../core/store.js";
import { get } from "../core/api.js";
import { attempt } from "../core/messages.js";
import "../charts/plotly_figure.js";

const lists = new Map(); // run → figures
const fetched = new Map(); // run and name → figure
const chosen = new Map(); // run → name

const base = (run) => `/api/runs/${encodeURIComponent(run)}`;

async function openList(run) {
  if (lists.has(run)) return;
  lists.set(run, null);
  const answer = await attempt(() => get(`${base(run)}/figures`));
  lists.set(run, answer?.figures ?? []);
  if (answer?.figures.length) show(run, answer.figures[0].name);
  changed();
}

async function show(run, name) {
  chosen.set(run, name);
  changed();
  const key = `${run} ${name}`;
  if (!fetched.has(key)) {
    const figure = await attempt(() => get(`${base(run)}/figures/${encodeURIComponent(name)}`));
    if (figure) fetched.set(key, figure);
  }
  changed();
}

export function figures(job) {
  const { run } = job;
  const list = lists.get(run);
  const name = chosen.get(run);
  const figure = fetched.get(`${run} ${name}`);
  return html`<section class="card" aria-label="Report"><header><h2>Report</h2>
      <a class="button" href=${`${base(run)}/report`} target="_blank" rel="noopener">Open the whole report</a></header>
    <details @toggle=${(event) => event.target.open && openList(run)}><summary>Its figures, to zoom</summary>
      ${list === null ? html`<i class="spinner"></i>` : nothing}
      ${list?.length ? html`<label class="field">Figure <select @change=${(event) => show(run, event.target.value)}>
        ${list.map((one) => html`<option value=${one.name} ?selected=${one.name === name}>${[one.title, one.record, one.channel].filter(Boolean).join(" · ")}</option>`)}</select></label>
        ${figure ? html`<plotly-figure .figure=${figure}></plotly-figure>` : html`<i class="spinner"></i>`}` : nothing}
      ${list && !list.length ? html`<p class="soft">It has none.</p>` : nothing}
    </details>
    ${job.command ? html`<details><summary>The same on the command line</summary><code class="command">${job.command}</code></details>` : nothing}</section>`;
}
