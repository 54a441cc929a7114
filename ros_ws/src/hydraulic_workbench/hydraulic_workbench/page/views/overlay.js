// Any two records, or a record and a model on its drive, over each other.
import { html, nothing } from "../core/html.js";
import { state, changed, update } from "../core/store.js";
import { get } from "../core/api.js";
import { attempt } from "../core/messages.js";
import { recordOf } from "../core/actions.js";
import { heading, words } from "../core/format.js";
import "../charts/series_chart.js";

const POINTS = 1600;
const DEFAULT = ["position", "drive", "command", "pressure_a", "pressure_b"];
const COLOURS = ["curve-1", "curve-2", "curve-3", "curve-4"];
const now = { key: "", charts: [], busy: false, channels: null, span: null, align: false };
let timer = null;

function items() {
  const records = state.shownRecords.map((id) => `record:${id}`);
  const models = [...new Set(state.overlayModels)].filter(Boolean).map((model) => `model:${model}@record:${state.shownRecords[0]}`);
  return [...records, ...models];
}

const available = () => [...new Set(state.shownRecords.flatMap((id) => recordOf(id)?.channels ?? []))];
const channels = () => (now.channels ?? DEFAULT).filter((name) => available().includes(name));

const wanted = () => JSON.stringify([items(), channels(), now.span]);

async function fetchAll() {
  const key = wanted();
  if (key === now.key) return;
  now.key = key;
  now.busy = true;
  const query = new URLSearchParams({ items: items().join(","), channels: channels().join(","), points: POINTS });
  if (now.span) {
    query.set("from", now.span[0]);
    query.set("to", now.span[1]);
  }
  const answer = await attempt(() => get(`/api/overlay?${query}`));
  if (key !== now.key) return;
  now.busy = false;
  if (answer) now.charts = channels().map((name) => chart(name, answer.series));
  changed();
}

function chart(name, series) {
  const shown = series.map((one, k) => ({ one, k })).filter(({ one }) => one.channels[name]);
  const display = shown[0]?.one.channels[name].display ?? { factor: 1, unit: "" };
  return {
    title: heading(words(name)), unit: display.unit, sync: "overlay", height: 180,
    series: shown.map(({ one, k }) => ({
      title: one.title, time: one.channels[name].time, value: one.channels[name].value, factor: display.factor, colour: COLOURS[k],
    })),
    onZoom: (from, to, whole) => zoomed(from, to, whole),
  };
}

/** Finer samples for what is shown. */
function zoomed(from, to, whole) {
  clearTimeout(timer);
  timer = setTimeout(() => {
    now.span = whole && !now.span ? null : [from, to];
    changed();
  }, 200);
}

function whole() {
  now.span = null;
  changed();
}

function toggle(name) {
  const all = new Set(channels());
  if (!all.delete(name)) all.add(name);
  now.channels = available().filter((one) => all.has(one));
  changed();
}

/** A model that runs on the drive of the first record; a second one once there is a first. */
function modelMenu(place) {
  const put = (event) => update({ overlayModels: state.overlayModels.with(place, event.target.value) });
  return html`<select aria-label=${place ? "Another model over the record" : "Model over the record"} id=${place ? "overlay-other-model" : "overlay-model"} @change=${put}>
    <option value="">${place ? "no other model" : "no model"}</option>
    ${state.models.map((model) => html`<option value=${model.id} ?selected=${model.id === state.overlayModels[place]}>${model.name}</option>`)}</select>`;
}

export function overlayView() {
  queueMicrotask(fetchAll);
  const names = state.shownRecords.map((id) => recordOf(id)?.name).filter(Boolean);
  return html`<section class="card" aria-label="Overlay" aria-busy=${now.busy || wanted() !== now.key}><header><h2>${names.join(" over ")}</h2>
      ${now.busy ? html`<i class="spinner"></i>` : nothing}
      ${now.span ? html`<button class="small" @click=${whole}>Whole record</button>` : nothing}
      ${modelMenu(0)}${state.overlayModels[0] ? modelMenu(1) : nothing}
      <details class="menu"><summary class="button">Channels</summary><div class="card popup stack tight">
        ${available().map((name) => html`<label class="check"><input type="checkbox" .checked=${channels().includes(name)}
          @change=${() => toggle(name)}> ${words(name)}</label>`)}</div></details></header>
    ${now.charts.map((one) => html`<series-chart .chart=${one}></series-chart>`)}
    <p class="soft small">Drag to zoom: every sample of what is shown is fetched. Double click for the whole.</p></section>`;
}
