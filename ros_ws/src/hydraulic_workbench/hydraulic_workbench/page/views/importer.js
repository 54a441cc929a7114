// A file becomes a record: it is sent, its columns are named with a preview, and the map is kept as YAML.
import { html, nothing } from "../core/html.js";
import { state, changed, update } from "../core/store.js";
import { path, post, put, remove } from "../core/api.js";
import { attempt, say } from "../core/messages.js";
import { operates } from "../core/actions.js";
import { digits, duration, words } from "../core/format.js";
import { columnsForm } from "./columns.js";
import "../charts/series_chart.js";

state.importing = null;
let timer = null;
const charts = new WeakMap();

/** Files that were dropped, folders with all that is in them. */
export async function take(transfer) {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  const files = (await Promise.all(entries.map((entry) => walk(entry, "")))).flat();
  await begin(files);
}

/** Files of a field. */
export async function takeFiles(input) {
  const files = [...input.files].map((file) => ({ path: file.webkitRelativePath || file.name, file }));
  input.value = "";
  await begin(files);
}

async function walk(entry, before) {
  if (entry.isFile) {
    const file = await new Promise((resolve, reject) => entry.file(resolve, reject));
    return [{ path: before + entry.name, file }];
  }
  const reader = entry.createReader();
  const inside = [];
  for (;;) { // a reader gives at most a hundred at once
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (!some.length) break;
    inside.push(...some);
  }
  return (await Promise.all(inside.map((one) => walk(one, `${before}${entry.name}/`)))).flat();
}

async function begin(files) {
  if (!files.length) return;
  const name = files[0].path.split("/")[0];
  const importing = { name, files, sent: 0, upload: null, preview: null, map: null, busy: true };
  update({ importing });
  const done = await attempt(async () => {
    const { upload } = await post("/api/uploads", { name });
    importing.upload = upload;
    for (const { path: inside, file } of files) {
      await put(`/api/uploads/${encodeURIComponent(upload)}/file/${inside.split("/").map(encodeURIComponent).join("/")}`, file);
      importing.sent += 1;
      changed();
    }
    await preview(importing, null);
    return true;
  });
  if (!done) await cancel();
}

async function preview(importing, map) {
  importing.busy = true;
  changed();
  const answer = await post(path("api", "uploads", importing.upload, "preview"), { columns: map });
  importing.busy = false;
  importing.preview = answer;
  importing.map ??= answer.needs_map ? structuredClone(answer.guess) : null;
  changed();
}

/** The map was changed: look at it again. */
export function mapChanged() {
  const { importing } = state;
  clearTimeout(timer);
  changed();
  timer = setTimeout(() => attempt(() => preview(importing, importing.map)), 250);
}

async function finish() {
  const { importing } = state;
  importing.busy = true;
  changed();
  const answer = await attempt(() => post(path("api", "uploads", importing.upload, "finish"), { columns: importing.map, name: importing.name.replace(/\.[^/]*$/, "") }));
  importing.busy = false;
  changed();
  if (!answer) return;
  update({ importing: null, shownRecords: [answer.record.id] });
  say(answer.columns_file ? `${answer.record.name} is in the list. Its columns are kept in ${answer.columns_file}.` : `${answer.record.name} is in the list.`, "good");
}

async function cancel() {
  const { importing } = state;
  update({ importing: null });
  if (importing?.upload) await attempt(() => remove(path("api", "uploads", importing.upload)));
}

function sample({ header, rows }) {
  if (!header?.length) return nothing;
  return html`<div class="scroll"><table class="sample"><thead><tr>${header.map((name) => html`<th>${name}</th>`)}</tr></thead>
    <tbody>${rows.slice(0, 5).map((row) => html`<tr>${row.map((cell) => html`<td class="number">${cell}</td>`)}</tr>`)}</tbody></table></div>`;
}

function curves(shown) {
  if (!shown.traces) return nothing;
  if (!charts.has(shown)) {
    charts.set(shown, Object.entries(shown.traces).map(([name, one], k) => ({
      title: words(name), unit: one.display.unit, sync: "import", height: 120,
      series: [{ title: "", time: one.time, value: one.value, factor: one.display.factor, colour: `curve-${1 + (k % 6)}` }],
    })));
  }
  return html`${charts.get(shown).map((chart) => html`<series-chart .chart=${chart}></series-chart>`)}`;
}

export function importer() {
  const { importing } = state;
  const shown = importing.preview;
  const ready = shown && !shown.problem && shown.record;
  return html`<section class="card" aria-label="Bring a record" aria-busy=${importing.busy}><header><h2>${importing.name}</h2>
      ${importing.busy ? html`<i class="spinner"></i>` : nothing}
      ${shown ? html`<span class="chip">${shown.kind}</span>` : nothing}</header>
    ${!shown ? html`<progress max=${importing.files.length} value=${importing.sent} aria-label="Sent"></progress>` : html`
      ${sample(shown)}
      ${!importing.map && shown.kind === "table" && shown.guess ? html`<button class="small quiet" @click=${() => { importing.map = structuredClone(shown.guess); mapChanged(); }}>Name the columns myself</button>` : nothing}
      ${importing.map ? columnsForm(importing.map, shown, mapChanged) : nothing}
      ${shown.problem ? html`<p class="notice fair" style="margin-top:10px">${shown.problem}</p>` : nothing}
      ${ready ? html`<p class="notice good" style="margin-top:10px">${duration(shown.record.duration)} at ${digits(1 / shown.record.sampling_time, 4)} Hz, ${shown.record.samples} samples: ${shown.record.channels.join(", ").replaceAll("_", " ")}</p>` : nothing}
      ${curves(shown)}`}
    <div class="row" style="margin-top:14px">
      <button class="primary" id="finish-import" ?disabled=${!operates() || !ready || importing.busy} @click=${finish}>Add to the records</button>
      <button @click=${cancel}>Cancel</button>
    </div></section>`;
}
