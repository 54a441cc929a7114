// Curves before and after: what was measured, and the model without and with what was added. What is left is the report's figure.
import { html, nothing } from "../core/html.js";
import { changed } from "../core/store.js";
import { displayOf } from "../core/quantities.js";
import { digits, heading, words } from "../core/format.js";
import { reportFigure } from "./figures.js";
import "../charts/series_chart.js";

const UNITS = { position: "m", velocity: "m/s", drive: "V" };
const unitOf = (channel) => UNITS[channel] ?? (channel.includes("pressure") ? "Pa" : "1");
const charts = new WeakMap();
let place = 0;
let errors = false;

function build(segment) {
  return Object.entries(segment.channels).map(([name, channel]) => {
    const { factor, unit } = displayOf(unitOf(name));
    const line = (title, value, colour, width) => ({ title, time: segment.time, value, factor, colour, width });
    return {
      title: heading(words(name)), unit, sync: "segment", height: 165,
      series: [line("measured", channel.measured, "curve-6", 2.5), line("before", channel.before, "curve-2", 1.6), line("after", channel.after, "curve-3", 1.6)],
    };
  });
}

/** The report's figure of a segment. */
const figureOf = (segment) => (title) => title.startsWith(`${segment.record}: `) && title.includes("before and after");

export function beforeAfter(doc, run) {
  const segments = doc.worst_segments ?? [];
  if (!segments.length) return nothing;
  const segment = segments[Math.min(place, segments.length - 1)];
  if (!charts.has(segment)) charts.set(segment, build(segment));
  const show = (wrong) => { errors = wrong; changed(); };
  return html`<section class="card" aria-label="Before and after"><header><h2>Before and after</h2>
      <div class="segmented" role="group" aria-label="Curves or errors">
        <button aria-pressed=${!errors} @click=${() => show(false)}>Curves</button><button aria-pressed=${errors} @click=${() => show(true)}>Errors</button></div>
      <div class="segmented" role="group" aria-label="Segment">${segments.map((one, k) => html`
        <button aria-pressed=${one === segment} @click=${() => { place = k; changed(); }}>${one.record} at ${digits(one.time[0], 3)} s</button>`)}</div></header>
    <p class="soft small">Where the model was off most${segment.role === "validation" ? ", on data that nothing was fitted to" : ""}.</p>
    ${errors ? reportFigure(run, figureOf(segment)) : charts.get(segment).map((chart) => html`<series-chart .chart=${chart}></series-chart>`)}</section>`;
}
