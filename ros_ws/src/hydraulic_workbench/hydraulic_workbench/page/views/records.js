// Records: what experiments made and what the user brings; any two, of records and models, over each other.
import { html, nothing, repeat } from "../core/html.js";
import { state, changed, update } from "../core/store.js";
import { path, remove } from "../core/api.js";
import { attempt } from "../core/messages.js";
import { ask } from "../core/dialogs.js";
import { operates } from "../core/actions.js";
import { clock, digits, duration, shortPath, words } from "../core/format.js";
import { uploadIcon } from "../core/icons.js";
import { diagnoseRecord } from "./diagnosis_steps.js";
import { importer, take, takeFiles } from "./importer.js";
import { overlayView } from "./overlay.js";

Object.assign(state, { shownRecords: [], overlayModels: ["", ""] });
let over = 0;

const SOURCES = { experiment: "measured here", imported: "brought", opened: "opened" };

function show(record, on) {
  const others = state.shownRecords.filter((id) => id !== record.id);
  update({ shownRecords: on ? [...others.slice(-1), record.id] : others });
}

async function forget(record) {
  const agreed = await ask({ title: `Take ${record.name} off the list?`, body: html`<p>The file stays where it is: <code>${record.file}</code></p>`, yes: "Take it off" });
  if (!agreed) return;
  await attempt(() => remove(path("api", "records", record.id)));
  update({ shownRecords: state.shownRecords.filter((id) => id !== record.id) });
}

function row(record) {
  const shown = state.shownRecords.includes(record.id);
  return html`<tr class=${shown ? "chosen" : ""}>
    <td><input type="checkbox" aria-label=${`Show ${record.name}`} .checked=${shown} ?disabled=${Boolean(record.problem)}
      @change=${(event) => show(record, event.target.checked)}></td>
    <th title=${record.file}>${record.name}<br><span class="soft small">${SOURCES[record.source] ?? record.source} ${clock(record.created)}</span></th>
    <td class="number">${duration(record.duration)}<br><span class="soft small">${record.sampling_time ? `${digits(1 / record.sampling_time, 4)} Hz` : ""}</span></td>
    <td class="small soft channels">${record.problem ? html`<span class="chip poor" title=${record.problem}>unreadable</span> ${record.problem}` : record.channels.map(words).join(", ")}
      ${record.columns ? html`<br><span title=${record.columns}>columns: ${shortPath(record.columns)}</span>` : nothing}</td>
    <td class="row-actions"><button class="small" ?disabled=${!operates() || Boolean(record.problem)} @click=${() => diagnoseRecord(record)}>Diagnose</button>
      <button class="small quiet" ?disabled=${!operates()} aria-label=${`Take ${record.name} off the list`} title="Take it off the list" @click=${() => forget(record)}>×</button></td>
  </tr>`;
}

async function dropped(event) {
  event.preventDefault();
  over = 0;
  changed();
  if (operates()) await take(event.dataTransfer);
}

function drop() {
  const count = (by) => (event) => { event.preventDefault(); over = Math.max(0, over + by); changed(); };
  return html`<section class="card drop ${over ? "over" : ""}" aria-label="Bring a record"
      @dragenter=${count(1)} @dragleave=${count(-1)} @dragover=${(event) => event.preventDefault()} @drop=${dropped}>
    ${uploadIcon()}
    <p><strong>Drop a CSV, MAT, HDF5 or Parquet file, or the folder of a bag</strong><br>
      <span class="soft small">A column map (YAML) may come along. Nothing leaves this machine.</span></p>
    <span class="row">
      <label class="button">Choose files<input type="file" multiple class="visually-hidden" id="choose-files" ?disabled=${!operates()}
        @change=${(event) => takeFiles(event.target)}></label>
      <label class="button">Choose a folder<input type="file" webkitdirectory class="visually-hidden" id="choose-folder" ?disabled=${!operates()}
        @change=${(event) => takeFiles(event.target)}></label>
    </span></section>`;
}

export function recordsView() {
  return html`
    <div class="title"><div><h1>Records</h1>
      <p>Bags of experiments arrive here by themselves. Tick one or two to see them over each other; models can join them.</p></div></div>
    <div class="stack">
      ${state.importing ? importer() : drop()}
      <section class="card flush" aria-label="List of records">
        ${state.records.length
          ? html`<div class="scroll"><table class="records"><thead><tr><th><span class="visually-hidden">Show</span></th><th>Record</th><th class="number">Length</th><th>Channels</th><th><span class="visually-hidden">Actions</span></th></tr></thead>
              <tbody>${repeat(state.records, (record) => record.id, row)}</tbody></table></div>`
          : html`<div class="empty"><p>No records yet. Run an <a href="#/experiment">experiment</a>, or drop a file above.</p></div>`}
      </section>
      ${state.shownRecords.length ? overlayView() : nothing}
    </div>`;
}
