// The model beside the records: how large the error is, over what it goes, and the samples behind a place.
import { html, nothing } from "../core/html.js";
import { changed } from "../core/store.js";
import { get } from "../core/api.js";
import { attempt } from "../core/messages.js";
import { displayOf, quantity } from "../core/quantities.js";
import { digits, words } from "../core/format.js";
import { errorMap } from "../charts/error_map.js";
import "../charts/series_chart.js";

const PREDICTIONS = [["one_step", "One step"], ["horizon", "Ahead"], ["free_run", "Free run"]];
const view = { run: null, channel: null, variable: null, bin: null, samples: null, chart: null };

/** Begin at the strongest dependence of another result. */
function settle(doc, run) {
  if (view.run === run) return;
  const maps = Object.entries(doc.error_maps).flatMap(([channel, all]) => Object.entries(all).map(([variable, map]) => ({ channel, variable, map })));
  const usable = maps.filter(({ variable, map }) => variable !== "time" && map.explained !== null);
  const best = usable.sort((a, b) => (b.map.explained - b.map.chance_level) - (a.map.explained - a.map.chance_level))[0] ?? maps[0];
  Object.assign(view, { run, channel: best?.channel, variable: best?.variable, bin: null, samples: null, chart: null });
}

function heat(ratio) {
  if (!Number.isFinite(ratio)) return "";
  const strength = Math.min(34, 9 * Math.log2(Math.max(1, ratio)));
  return `background:color-mix(in srgb, var(--${ratio < 1.5 ? "good" : "poor"}) ${ratio < 1.5 ? 12 : strength}%, transparent)`;
}

function summary(doc) {
  return html`<div class="scroll"><table class="summary"><thead><tr><th>Channel</th>${PREDICTIONS.map(([key, title]) => html`
      <th class="number">${key === "horizon" ? `${digits(doc.settings.horizon, 2)} s ahead` : title}</th>`)}</tr></thead>
    <tbody>${Object.entries(doc.summary).map(([channel, all]) => html`<tr><th>${doc.channels[channel]?.title ?? words(channel)}</th>
      ${PREDICTIONS.map(([key]) => html`<td class="number" style=${heat(all[key]?.ratio)}>${all[key]?.ratio === null || !all[key] ? "–" : html`<b>${digits(all[key].ratio, 3)} ×</b>
        <br><span class="soft small">${quantity(all[key].rmse, doc.channels[channel].unit, 3)}</span>`}</td>`)}</tr>`)}</tbody></table></div>
    <p class="soft small">× what an exact model would show at this noise; below it the root mean square error.</p>`;
}

async function choose(doc, run, bin, low, high) {
  view.bin = bin;
  view.samples = null;
  changed();
  const query = new URLSearchParams({ channel: view.channel, variable: view.variable, low, high, points: 1500 });
  const answer = await attempt(() => get(`/api/runs/${encodeURIComponent(run)}/samples?${query}`));
  if (!answer || view.bin !== bin || view.run !== run) return;
  view.samples = answer;
  const error = displayOf(doc.channels[view.channel].unit);
  view.chart = {
    title: `Error of ${doc.channels[view.channel].title}`, unit: error.unit, height: 150,
    series: [{ title: "behind this place", ...inOrder(answer.samples), factor: error.factor, colour: "curve-2", points: true }],
    lines: [{ value: 0, title: "", colour: "soft" }],
  };
  changed();
}

/** Samples in the order of their time, each time once. */
function inOrder({ time, error }) {
  const order = time.map((_, k) => k).sort((a, b) => time[a] - time[b]);
  const kept = order.filter((k, place) => place === 0 || time[k] !== time[order[place - 1]]);
  return { time: kept.map((k) => time[k]), value: kept.map((k) => error[k]) };
}

function behind() {
  if (view.bin === null) return html`<p class="soft small">Click a place of the map to see the samples behind it.</p>`;
  if (!view.samples) return html`<p><i class="spinner"></i></p>`;
  const { segments, text } = view.samples;
  return html`<div class="behind"><p>${text}</p>
    ${view.chart ? html`<series-chart .chart=${view.chart}></series-chart>` : nothing}
    <p class="soft small">${segments.slice(0, 6).map((one) => `${one.record} ${digits(one.from, 3)} … ${digits(one.to, 3)} s`).join(" · ")}${segments.length > 6 ? ` and ${segments.length - 6} more` : ""}</p></div>`;
}

function maps(doc, run) {
  const channels = Object.keys(doc.error_maps);
  if (!channels.length) return nothing;
  const all = doc.error_maps[view.channel];
  const map = all[view.variable];
  const pick = (more) => { Object.assign(view, { bin: null, samples: null }, more); changed(); };
  const title = (name) => doc.variables?.[name]?.title ?? words(name);
  return html`<section class="card" aria-label="Where the error is"><header><h2>Where the error is</h2></header>
    <div class="row"><div class="segmented" role="group" aria-label="Error of">${channels.map((name) => html`
        <button aria-pressed=${name === view.channel} @click=${() => pick({ channel: name })}>${doc.channels[name]?.title ?? words(name)}</button>`)}</div>
      <span class="soft">over</span>
      <div class="segmented" role="group" aria-label="Over">${Object.keys(all).map((name) => html`
        <button aria-pressed=${name === view.variable} @click=${() => pick({ variable: name })}>${title(name)}</button>`)}</div></div>
    ${map ? errorMap({
      map, chosen: view.bin, choose: (bin, low, high) => choose(doc, run, bin, low, high),
      value: { ...displayOf(doc.variables[view.variable].unit), title: title(view.variable) },
      error: { ...displayOf(doc.channels[view.channel].unit), title: doc.channels[view.channel].title },
    }) : nothing}
    ${map && map.explained !== null ? html`<p class="soft small">The mean over ${title(view.variable)} explains ${digits(100 * Math.max(0, map.explained), 2)} % of the error
      (up to ${digits(100 * (map.chance_level ?? 0), 2)} % may be chance).</p>` : nothing}
    ${behind()}</section>`;
}

export function compareResult(doc, job) {
  settle(doc, job.run);
  return html`
    <section class="card" aria-label="Comparison"><header><h2>${doc.model.name} beside ${job.records?.length === 1 ? "the record" : "the records"}</h2></header>
      <p class="verdict ${doc.verdict.level}">${doc.verdict.text}</p>
      ${summary(doc)}
      <details><summary>Findings (${doc.findings.length})</summary><ul class="findings">${doc.findings.map((one) => html`<li>${one.text}</li>`)}</ul></details></section>
    ${maps(doc, job.run)}`;
}
